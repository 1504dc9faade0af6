// The goal of the default strategy: the candidate of least cost. The cost of a candidate includes the route to it, and routes are found
// in the order of their cost. A candidate without a route yet costs at least what it would cost with a route as long as the last one
// found. As soon as no such candidate can be the goal, the search ends. With the default settings and 430 candidates in the scene
// "hall", seven routes are found on average; finding them all took a fifth of a step.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "server/move/cell_table.h"
#include "server/move/choose.h"
#include "server/move/cost.h"
#include "server/move/route.h"

namespace sightline {

// How far inside a group of members a candidate lies, computed for one candidate at a time. Memory is kept from call to call. Not
// thread-safe.
class EdgeDepths {
 public:
  // The candidates' cells (see lattice_cells), and which are members (not 0). Both spans have one length and must outlive the calls of
  // `squared`. A cell belongs to the first candidate in it. O(candidates).
  void begin(std::span<const glm::ivec3> cell, std::span<const uint8_t> member);

  // Distance from the candidate's cell to the nearest cell that is no member's, in grid steps squared, at most `enough_steps` squared. A
  // cell without a candidate is no member's. 0 for a candidate that is no member itself, or whose cell is no member's. The cost grows
  // with the answer.
  uint32_t squared(size_t candidate, uint32_t enough_steps) const;

 private:
  bool is_member(const glm::ivec3& cell) const;

  std::span<const glm::ivec3> cell_;
  std::span<const uint8_t> member_;
  CellTable first_;
};

// The input for the choice of a goal. All parts belong to one set of candidates.
struct GoalInput {
  const CandidateCosts& costs;
  const EdgeDepths& edge_depths;
  const PlaceLimits& limits;  // candidates outside come after all inside
  std::span<const glm::dvec3> position_m;
};

// The candidate of least cost among those that can be reached; of equal ones the first. The answer is the same as if all routes were
// known. `routes` must have begun with the candidates as its nodes; on return it has settled the answer.
uint32_t find_goal(const GoalInput& input, RouteFinder& routes);

}  // namespace sightline
