#include "server/paper/groups.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

namespace sightline {
namespace {

// The six faces first.
constexpr std::array<glm::ivec3, 26> steps_to_neighbours() {
  std::array<glm::ivec3, 26> steps{{{-1, 0, 0}, {1, 0, 0}, {0, -1, 0}, {0, 1, 0}, {0, 0, -1}, {0, 0, 1}}};
  size_t count = 6;
  for (int z = -1; z <= 1; ++z)
    for (int y = -1; y <= 1; ++y)
      for (int x = -1; x <= 1; ++x)
        if (x * x + y * y + z * z > 1) steps[count++] = {x, y, z};
  return steps;
}
constexpr std::array<glm::ivec3, 26> kSteps = steps_to_neighbours();

class Finder {
 public:
  Finder(std::span<const glm::ivec3> cell, std::span<const glm::ivec3> steps, std::span<const uint8_t> member,
         GroupScratch& scratch, Groups& groups)
      : cell_(cell), steps_(steps), member_(member), s_(scratch), g_(groups) {}

  void index_cells() {
    const size_t n = cell_.size();
    s_.table.clear(cell_);
    s_.first_in_cell.resize(n);
    for (size_t i = 0; i < n; ++i) {
      int32_t& slot = s_.table.slot_of(cell_[i]);
      if (slot < 0) slot = static_cast<int32_t>(i);
      s_.first_in_cell[i] = slot;
    }
  }

  void link_neighbours() {
    s_.beside.resize(cell_.size());
    if (s_.table.box()) return link_in_box(*s_.table.box());
    for (size_t i = 0; i < cell_.size(); ++i) {
      if (!owns_member_cell(i)) continue;
      for (size_t k = 0; k < steps_.size(); ++k) {
        const int32_t other = s_.table.slot_of(cell_[i] + steps_[k]);
        s_.beside[i][k] = other >= 0 && member_[other] ? other : -1;
      }
    }
  }

  // There may be as many groups as candidates, or one group of all. Memory for either case is reserved from the start.
  void flood_all() {
    g_.size_cells.clear();
    g_.size_cells.reserve(cell_.size());
    s_.nearest_m.reserve(cell_.size());
    s_.queue.reserve(cell_.size());
    g_.group_of.assign(cell_.size(), kNoGroup);
    for (size_t i = 0; i < cell_.size(); ++i)
      if (owns_member_cell(i) && g_.group_of[i] == kNoGroup) flood(static_cast<int32_t>(i));
  }

  // Gives every member the group of its cell: none where the first candidate of the cell is no member.
  void share_out() {
    for (size_t i = 0; i < cell_.size(); ++i)
      if (member_[i]) g_.group_of[i] = g_.group_of[s_.first_in_cell[i]];
  }

 private:
  bool owns_member_cell(size_t i) const { return member_[i] && s_.first_in_cell[i] == static_cast<int32_t>(i); }

  // The table keeps the cells of members alone; neighbours lie at fixed ways from each other in it.
  void link_in_box(const CellBox& box) {
    for (size_t i = 0; i < cell_.size(); ++i)
      if (!member_[i] && s_.first_in_cell[i] == static_cast<int32_t>(i)) s_.table.slot_of(cell_[i]) = -1;
    const auto row = static_cast<ptrdiff_t>(box.row()), slice = static_cast<ptrdiff_t>(box.slice());
    for (size_t i = 0; i < cell_.size(); ++i) {
      if (!owns_member_cell(i)) continue;
      const int32_t* const at = &s_.table.slot_of(cell_[i]);
      for (size_t k = 0; k < steps_.size(); ++k)
        s_.beside[i][k] = at[steps_[k].x + steps_[k].y * row + steps_[k].z * slice];
    }
  }

  void flood(int32_t from) {
    const auto group = static_cast<int32_t>(g_.size_cells.size());
    s_.queue.assign(1, from);
    g_.group_of[from] = group;
    for (size_t head = 0; head < s_.queue.size(); ++head) {
      for (const int32_t next : std::span(s_.beside[s_.queue[head]]).first(steps_.size())) {
        if (next < 0 || g_.group_of[next] != kNoGroup) continue;
        g_.group_of[next] = group;
        s_.queue.push_back(next);
      }
    }
    g_.size_cells.push_back(static_cast<uint32_t>(s_.queue.size()));
  }

  std::span<const glm::ivec3> cell_, steps_;  // steps to the neighbouring cells
  std::span<const uint8_t> member_;
  GroupScratch& s_;
  Groups& g_;
};

// Distances are measured only when several groups have the same size.
int32_t choose_largest(std::span<const glm::dvec3> position_m, const glm::dvec3& desired_m,
                       std::vector<double>& nearest_m, const Groups& g) {
  if (g.size_cells.empty()) return kNoGroup;
  const auto largest = std::max_element(g.size_cells.begin(), g.size_cells.end());
  if (std::count(g.size_cells.begin(), g.size_cells.end(), *largest) == 1)
    return static_cast<int32_t>(largest - g.size_cells.begin());
  nearest_m.assign(g.size_cells.size(), std::numeric_limits<double>::infinity());
  for (size_t i = 0; i < position_m.size(); ++i) {
    if (g.group_of[i] == kNoGroup) continue;
    double& nearest = nearest_m[g.group_of[i]];
    nearest = std::min(nearest, glm::distance(position_m[i], desired_m));
  }
  int32_t best = kNoGroup;
  for (int32_t k = 0; k < static_cast<int32_t>(g.size_cells.size()); ++k)
    if (g.size_cells[k] == *largest && (best == kNoGroup || nearest_m[k] < nearest_m[best])) best = k;
  return best;
}

constexpr int32_t kFar = 1 << 28;  // more than any squared distance; twice as much still fits an int

// For each cell of a line: the least of (distance of another cell + squared way to it). Lines are short, so every pair
// is tried.
void spread_line(int32_t* first, size_t stride, int count, std::vector<int32_t>& line) {
  line.resize(count);
  for (int i = 0; i < count; ++i) line[i] = first[i * stride];
  for (int to = 0; to < count; ++to) {
    int32_t least = kFar;
    for (int from = 0; from < count; ++from) least = std::min(least, line[from] + (to - from) * (to - from));
    first[to * stride] = least;
  }
}

// The squared distance is a sum over the axes, so one pass along each axis finds it.
void spread(const CellBox& box, EdgeDistanceScratch& s) {
  const size_t row = box.row(), slice = box.slice();
  for (int z = 0; z < box.size.z; ++z)
    for (int y = 0; y < box.size.y; ++y) spread_line(&s.distance[z * slice + y * row], 1, box.size.x, s.line);
  for (int z = 0; z < box.size.z; ++z)
    for (int x = 0; x < box.size.x; ++x) spread_line(&s.distance[z * slice + x], row, box.size.y, s.line);
  for (size_t in_slice = 0; in_slice < slice; ++in_slice) spread_line(&s.distance[in_slice], slice, box.size.z, s.line);
}

}  // namespace

void find_groups(std::span<const glm::ivec3> cell, Neighbours neighbours, std::span<const glm::dvec3> position_m,
                 std::span<const uint8_t> member, const glm::dvec3& desired_m, GroupScratch& scratch, Groups& groups) {
  assert(cell.size() == position_m.size() && cell.size() == member.size());
  Finder finder(cell, std::span(kSteps).first(neighbours == Neighbours::kFaces ? 6 : 26), member, scratch, groups);
  finder.index_cells();
  finder.link_neighbours();
  finder.flood_all();
  finder.share_out();
  groups.largest = choose_largest(position_m, desired_m, scratch.nearest_m, groups);
}

void measure_edge_distances(std::span<const glm::ivec3> cell, std::span<const uint8_t> member,
                            EdgeDistanceScratch& scratch, std::vector<uint32_t>& edge_distance_squared) {
  assert(cell.size() == member.size());
  edge_distance_squared.assign(cell.size(), kAllOpen);
  if (std::find(member.begin(), member.end(), 0) == member.end()) return;
  const CellBox box = box_around(cell, 0);
  scratch.distance.assign(box.count(), kFar);
  for (size_t i = 0; i < cell.size(); ++i)
    if (!member[i]) scratch.distance[box.address(cell[i])] = 0;
  spread(box, scratch);
  for (size_t i = 0; i < cell.size(); ++i)
    edge_distance_squared[i] = static_cast<uint32_t>(scratch.distance[box.address(cell[i])]);
}

}  // namespace sightline
