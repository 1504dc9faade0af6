// Shelter: how far every candidate is from the nearest one that does not see (paper 6.1: RobustMove favours
// "configurations located away from occluded areas").
//
// Unlike the depth of a group (groups.h), which also counts the way to the edge of the bound: beyond it
// nothing is known to be hidden. By depth the centre of a wholly visible bound would be the best place, which
// is where the camera is: it would stand until its targets are nearly lost.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

namespace sightline {

// Grid steps squared of a candidate where nothing is hidden at all.
inline constexpr uint32_t kAllOpen = UINT32_MAX;

// Working memory, grown as needed and then kept.
struct ShelterScratch {
  std::vector<int32_t> distance, line;  // over the box around the cells, x fastest
};

// shelter_squared[i] becomes the distance of cell[i], in grid steps squared, to the nearest cell of a candidate with
// member[i] == 0: 0 there, kAllOpen when there is none. Cells without a candidate count for nothing. Exact; cells as of
// lattice_cells, at most 1,000 steps apart. O(box * (its longest side)). Spans of one length.
void measure_shelter(std::span<const glm::ivec3> cell, std::span<const uint8_t> member,
                     ShelterScratch& scratch, std::vector<uint32_t>& shelter_squared);

}  // namespace sightline
