// Depths: how deep a candidate lies among members, as Groups has it for all (groups.h), for who asks for a few candidates alone.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <span>

#include "server/move/cell_table.h"

namespace sightline {

// Memory is kept from call to call. Not thread-safe.
class Depths {
 public:
  // Spans of one length, as find_groups takes them; they must outlive the questions. O(candidates).
  void begin(std::span<const glm::ivec3> cell, std::span<const uint8_t> member);

  // Grid steps squared to the nearest cell that is no member, a cell without any candidate being one, or `enough_steps` squared where
  // none is nearer than that; 0 of a candidate that is no member or is in the cell of one. Cells are looked at as far out as the
  // answer.
  uint32_t squared(size_t candidate, uint32_t enough_steps) const;

 private:
  bool is_member(const glm::ivec3& cell) const;

  std::span<const glm::ivec3> cell_;
  std::span<const uint8_t> member_;
  CellTable first_;
};

}  // namespace sightline
