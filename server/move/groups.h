// Groups: which candidates hang together, and how deep each lies inside its group (paper 6.1, strategy
// "RobustMove").
//
// The paper gathers the unoccluded candidates with their unoccluded neighbours and moves to the centre of the
// largest group. A centre of mass can itself be hidden (a ring around a pillar has its centre in the pillar),
// so the centre here is the deepest *member*: the one farthest from everything that is not a member. Depth is
// also given for every candidate, so that a cost can prefer sheltered places without having to take the
// single deepest.
#pragma once

#include <array>
#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "server/aggregate/places.h"
#include "server/move/cell_table.h"

namespace sightline {

inline constexpr int32_t kNoGroup = -1;

// What was found; memory is reused from call to call. Vectors run parallel to the candidates unless they say
// otherwise.
struct Groups {
  std::vector<int32_t> group_of;  // index into `size_cells`, kNoGroup for a candidate that is in none
  std::vector<uint32_t>
      depth_squared;  // grid steps squared to the nearest cell that is no member; 0 in no group
  std::vector<uint32_t> size_cells;  // per group
  int32_t largest =
      kNoGroup;  // the group with most cells; of equal ones that with a member nearest to the desired place
  int32_t deepest =
      -1;  // candidate: the deepest member of `largest`; of equal ones the nearest to the desired place
  uint32_t max_depth_squared = 0;  // over all groups

  // Grid steps to the nearest cell that is no member: 1 at the rim of a group, 0 outside.
  double depth_steps(size_t candidate) const;
  // The same as a share of the greatest depth of this step, [0, 1]; 0 when there is no member at all.
  double depth_share(size_t candidate) const;
};

// Working memory of find_groups, grown as needed and then kept: no allocation in the steady state.
struct GroupScratch {
  CellTable table;                             // of the first candidates
  std::vector<int32_t> first_in_cell;          // per candidate
  std::vector<std::array<int32_t, 6>> beside;  // per candidate: members at -x, +x, -y, +y, -z, +z, or -1
  std::vector<int32_t> queue;
  std::vector<int32_t> line, distance;  // of one run of members along an axis
  std::vector<int32_t> run;
  std::vector<double> nearest_m;  // per group
};

// Cells of a cubic lattice anchored to the world: round(position / spacing). spacing_m > 0; |position| < 2^31
// spacings.
// Those of runs, of a lattice of this spacing, are told.
void lattice_cells(const PlaceView& places, double spacing_m, std::vector<glm::ivec3>& cells);

// Finds the connected groups (6-neighbourhood) of the candidates with member[i] != 0, and their depths: exact
// Euclidean distances on the grid to the nearest cell that is no member, a cell without any candidate being
// one. All spans have one length. `cell` may be the lattice's or the (u, v, w) of a pair volume. A cell
// belongs to the first candidate in it; later ones (a place off the grid, such as the camera's own) share its
// group and depth if both are members, and are in no group otherwise. O(candidates * depth); equal inputs give equal
// results.
void find_groups(std::span<const glm::ivec3> cell, std::span<const glm::dvec3> position_m,
                 std::span<const uint8_t> member, const glm::dvec3& desired_m, GroupScratch& scratch,
                 Groups& groups);

}  // namespace sightline
