#include "server/move/depths.h"

#include <algorithm>
#include <cstdlib>

namespace sightline {

void Depths::begin(std::span<const glm::ivec3> cell, std::span<const uint8_t> member) {
  cell_ = cell, member_ = member;
  first_.clear(cell);
  for (size_t i = 0; i < cell.size(); ++i)
    if (int32_t& slot = first_.slot_of(cell[i]); slot < 0) slot = static_cast<int32_t>(i);
}

bool Depths::is_member(const glm::ivec3& cell) const {
  const int32_t first = first_.candidate_in(cell);
  return first >= 0 && member_[static_cast<size_t>(first)] != 0;
}

// Shell by shell of cells that are equally far along an axis. No cell of a shell is nearer than that, so that the first shell that is
// no nearer than what was found is the last; and what lies beyond the cells' rim is never asked for, as the rim is nearer.
uint32_t Depths::squared(size_t candidate, uint32_t enough_steps) const {
  const glm::ivec3 at = cell_[candidate];
  if (member_[candidate] == 0 || !is_member(at)) return 0;
  uint32_t least = enough_steps * enough_steps;
  const auto look_at = [&](int x, int y, int z) {
    const auto squared = static_cast<uint32_t>(x * x + y * y + z * z);
    if (squared < least && !is_member(at + glm::ivec3(x, y, z))) least = squared;
  };
  for (int way = 1; static_cast<uint32_t>(way * way) < least; ++way)
    for (int z = -way; z <= way; ++z)
      for (int y = -way; y <= way; ++y) {
        const bool side = std::max(std::abs(z), std::abs(y)) == way;
        for (int x = -way; x <= way; x += side ? 1 : 2 * way) look_at(x, y, z);
      }
  return least;
}

}  // namespace sightline
