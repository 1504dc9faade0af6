#include "server/move/shelter.h"

#include <algorithm>
#include <cassert>

#include "server/move/cell_box.h"

namespace sightline {
namespace {

constexpr int32_t kFar = 1 << 28;  // more than any squared distance, and twice it still is an int

// Along one line: the least of distance + squared way to it. Lines are short, so every pair is looked at.
void spread_line(int32_t* first, size_t stride, int count, std::vector<int32_t>& line) {
  line.resize(count);
  for (int i = 0; i < count; ++i) line[i] = first[i * stride];
  for (int to = 0; to < count; ++to) {
    int32_t least = kFar;
    for (int from = 0; from < count; ++from) least = std::min(least, line[from] + (to - from) * (to - from));
    first[to * stride] = least;
  }
}

// The squared distance is a sum over the axes: one pass an axis.
void spread(const CellBox& box, ShelterScratch& s) {
  const size_t row = box.row(), slice = box.slice();
  for (int z = 0; z < box.size.z; ++z)
    for (int y = 0; y < box.size.y; ++y) spread_line(&s.distance[z * slice + y * row], 1, box.size.x, s.line);
  for (int z = 0; z < box.size.z; ++z)
    for (int x = 0; x < box.size.x; ++x) spread_line(&s.distance[z * slice + x], row, box.size.y, s.line);
  for (size_t in_slice = 0; in_slice < slice; ++in_slice)
    spread_line(&s.distance[in_slice], slice, box.size.z, s.line);
}

}  // namespace

void measure_shelter(std::span<const glm::ivec3> cell, std::span<const uint8_t> member,
                     ShelterScratch& scratch, std::vector<uint32_t>& shelter_squared) {
  assert(cell.size() == member.size());
  shelter_squared.assign(cell.size(), kAllOpen);
  if (std::find(member.begin(), member.end(), 0) == member.end()) return;
  const CellBox box = box_around(cell, 0);
  scratch.distance.assign(box.count(), kFar);
  for (size_t i = 0; i < cell.size(); ++i)
    if (!member[i]) scratch.distance[box.address(cell[i])] = 0;
  spread(box, scratch);
  for (size_t i = 0; i < cell.size(); ++i)
    shelter_squared[i] = static_cast<uint32_t>(scratch.distance[box.address(cell[i])]);
}

}  // namespace sightline
