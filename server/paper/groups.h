// Connected groups of candidates, and how far each candidate is from the nearest one that does not see (paper 6.1): the
// parts of the paper's strategy "RobustMove" (Strategy::kRobust).
//
// The paper gathers the unoccluded candidates with their unoccluded neighbours and moves to the centre of the largest
// group (RobustGoal::kCenter). A centre of mass can itself be hidden: a ring around a pillar has its centre in the
// pillar. So the default goal is a member of the largest group, the one farthest from everything hidden
// (RobustGoal::kDeepestMember); the paper favours "configurations located away from occluded areas". Distances do not
// count the edge of the bound, beyond which nothing is known to be hidden. Otherwise the camera's own position, the
// centre of a fully visible bound, would always be the best.
#pragma once

#include <array>
#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "server/move/cell_table.h"

namespace sightline {

inline constexpr int32_t kNoGroup = -1;

// The groups of one step. Memory is reused from call to call.
struct Groups {
  std::vector<int32_t> group_of;     // by candidate: index into `size_cells`, or kNoGroup
  std::vector<uint32_t> size_cells;  // by group
  // The group with most cells; of equal ones the one with a member nearest to the desired position.
  int32_t largest = kNoGroup;
};

// Working memory of find_groups, grown as needed and then kept: no allocation in the steady state.
struct GroupScratch {
  CellTable table;                              // of the first candidates
  std::vector<int32_t> first_in_cell;           // by candidate
  std::vector<std::array<int32_t, 26>> beside;  // by candidate: members in the neighbouring cells, or -1
  std::vector<int32_t> queue;
  std::vector<double> nearest_m;  // by group
};

// The cells that are neighbours: those that share a face, or all that touch. Of a pair volume all that touch: where the
// rays of its targets are nearly parallel, only some combinations of columns meet in the bound, and those beside each
// other differ by one step in u and in w.
enum class Neighbours { kFaces, kTouching };

// Finds the connected groups of the candidates with member[i] != 0. All spans have one length. `cell` may be the
// lattice's or the (u, v, w) of a pair volume. A cell belongs to the first candidate in it. Later ones (a position off
// the grid, such as the camera's own) share its group if both are members, and are in no group otherwise.
// O(candidates); deterministic.
void find_groups(std::span<const glm::ivec3> cell, Neighbours neighbours, std::span<const glm::dvec3> position_m,
                 std::span<const uint8_t> member, const glm::dvec3& desired_m, GroupScratch& scratch, Groups& groups);

// Edge distance of a candidate, in grid steps squared, where nothing is hidden at all.
inline constexpr uint32_t kAllOpen = UINT32_MAX;

// Working memory of measure_edge_distances, grown as needed and then kept.
struct EdgeDistanceScratch {
  std::vector<int32_t> distance, line;  // over the box around the cells, x fastest
};

// edge_distance_squared[i] becomes the distance from cell[i], in grid steps squared, to the nearest cell of a candidate
// with member[i] == 0. It is 0 for such a candidate itself, and kAllOpen when there is none. Cells without a candidate
// count for nothing. Exact. Cells are at most 1,000 steps apart. O(box * its longest side). All spans have one length.
void measure_edge_distances(std::span<const glm::ivec3> cell, std::span<const uint8_t> member,
                            EdgeDistanceScratch& scratch, std::vector<uint32_t>& edge_distance_squared);

}  // namespace sightline
