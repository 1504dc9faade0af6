// The box of lattice cells around candidates, as addresses into arrays of one entry a cell: x fastest, then y, then z.
#pragma once

#include <cstddef>
#include <glm/glm.hpp>
#include <span>

namespace sightline {

struct CellBox {
  glm::ivec3 low{0};  // the cell at address 0
  glm::ivec3 size{0};

  size_t address(const glm::ivec3& cell) const {
    const glm::ivec3 at = cell - low;
    return static_cast<size_t>(at.z) * slice() + static_cast<size_t>(at.y) * row() + static_cast<size_t>(at.x);
  }
  size_t row() const { return static_cast<size_t>(size.x); }
  size_t slice() const { return row() * static_cast<size_t>(size.y); }
  size_t count() const { return slice() * static_cast<size_t>(size.z); }
};

// Around all of at least one cell, and `rim` cells more on every side, so that neighbours need no test. The cells are less than
// 2^30 apart.
inline CellBox box_around(std::span<const glm::ivec3> cell, int rim) {
  glm::ivec3 low = cell[0], high = cell[0];
  for (const glm::ivec3& c : cell) low = glm::min(low, c), high = glm::max(high, c);
  return {low - rim, high - low + 1 + 2 * rim};
}

}  // namespace sightline
