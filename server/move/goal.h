// Goal: the candidate of least cost (strategy kMinCost). What a candidate costs hangs on the way to it too, and ways are found one after
// the other, the nearest place first. Every other place costs at least what it would with a way no longer than the last: once none of
// them could still be the goal, the rest need no way. At the default settings seven places of 430 are settled on average in the hall,
// where all their ways took a fifth of a step.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <span>

#include "server/move/choose.h"
#include "server/move/cost.h"
#include "server/move/depths.h"
#include "server/move/route.h"

namespace sightline {

// Of one set of candidates.
struct GoalInput {
  const CandidateCosts& costs;
  const Depths& depths;
  const PlaceLimits& limits;  // places outside come after all inside
  std::span<const glm::dvec3> position_m;
};

// The candidate of least cost, of equals the first: the same as when all ways were known. `routes` has begun with the candidates as its
// nodes; the answer is one that it has settled.
uint32_t find_goal(const GoalInput& input, RouteFinder& routes);

}  // namespace sightline
