// The lattice cells of candidates: which cell a candidate is in, and which candidate is the first in a cell. The cells
// of a ball fill most of their bounding box, so the table is an array over that box. Where cells are too scattered for
// that, it is a hash table.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/glm.hpp>
#include <optional>
#include <span>
#include <vector>

#include "server/aggregate/places.h"

namespace sightline {

// Cells of a cubic lattice anchored to the world: round(position / spacing). spacing_m > 0; |position| < 2^31 spacings.
// Runs must be of a lattice of this spacing.
void lattice_cells(const PlaceView& places, double spacing_m, std::vector<glm::ivec3>& cells);

// A box of cells as addresses into arrays with one entry a cell: x fastest, then y, then z.
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

// The box around all cells, of which there is at least one, widened by `rim` cells on every side so that neighbours
// need no test. The cells are less than 2^30 apart.
inline CellBox box_around(std::span<const glm::ivec3> cell, int rim) {
  glm::ivec3 low = cell[0], high = cell[0];
  for (const glm::ivec3& c : cell) low = glm::min(low, c), high = glm::max(high, c);
  return {low - rim, high - low + 1 + 2 * rim};
}

// The first candidate in each cell. Memory is kept from call to call. Not thread-safe.
class CellTable {
 public:
  // Empties the table and sizes it for candidates in these cells. `cell` must outlive the use of the table.
  void clear(std::span<const glm::ivec3> cell);
  // The slot of a cell, which must be a candidate's cell or next to one. It holds the candidate, or -1 while there is
  // none.
  int32_t& slot_of(const glm::ivec3& cell) { return slots_[index_of(cell)]; }
  int32_t candidate_in(const glm::ivec3& cell) const { return slots_[index_of(cell)]; }
  // The box of the array, one cell wider than the cells on every side; neighbours are at fixed offsets in it. Empty
  // when hashed.
  const std::optional<CellBox>& box() const { return box_; }

 private:
  size_t index_of(const glm::ivec3& cell) const { return box_ ? box_->address(cell) : hashed(cell); }
  size_t hashed(const glm::ivec3& cell) const;

  std::span<const glm::ivec3> cell_;
  std::optional<CellBox> box_;
  std::vector<int32_t> slots_;
};

}  // namespace sightline
