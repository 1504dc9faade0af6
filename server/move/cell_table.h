// Which candidate is the first in a cell: a table over the box around the cells; where they are too scattered for that, a hash table.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <optional>
#include <span>
#include <vector>

#include "server/move/cell_box.h"

namespace sightline {

// Memory is kept from call to call.
class CellTable {
 public:
  // Of candidates in these cells, none of which is in the table yet. `cell` must outlive its use.
  void clear(std::span<const glm::ivec3> cell);
  // The slot that holds a candidate of the cell, or -1 in the free one where it would be put. The cell is a candidate's or beside one.
  int32_t& slot_of(const glm::ivec3& cell) { return slots_[index_of(cell)]; }
  int32_t candidate_in(const glm::ivec3& cell) const { return slots_[index_of(cell)]; }
  // Cells that are neighbours lie at fixed ways from each other in the slots of a box; one more than the cells' on every side. None: hashed.
  const std::optional<CellBox>& box() const { return box_; }

 private:
  size_t index_of(const glm::ivec3& cell) const { return box_ ? box_->address(cell) : hashed(cell); }
  size_t hashed(const glm::ivec3& cell) const;

  std::span<const glm::ivec3> cell_;
  std::optional<CellBox> box_;
  std::vector<int32_t> slots_;
};

}  // namespace sightline
