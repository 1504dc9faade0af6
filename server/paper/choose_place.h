// Chooses the goal among the candidates (paper 3.4). The choice falls back in this order: candidates that see all
// targets, the best partial view by target weight (required before optional targets), escape, hold. Among candidates
// that see the same targets, the one of least cost wins; Basic and RobustMove are different costs (robust_costs.h).
//
// The paper leaves open what the goal should be nearest to. With Follow::kOffset it is the desired position, which
// keeps the shot while targets walk. With Follow::kStay it is the camera's own position.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "server/aggregate/candidates.h"
#include "server/move/choose.h"

namespace sightline {

// Returns whether the camera body can go straight to a position.
using Reachable = std::function<bool(const glm::dvec3& place_m)>;

// At most this many candidates of one set are tested for reachability, nearest first. This bounds the cost of a step.
inline constexpr int kMaxReachTests = 24;

// The sort key of a candidate, and memory for the keys that is reused from step to step.
struct ChoiceKey {
  double required = 0, optional = 0;  // summed weights of the required and of the optional targets that it sees
  double cost = 0;
  glm::dvec3 place_m{0.0};
  uint32_t candidate = 0;
  bool within_limits = false;
};
struct ChoiceScratch {
  std::vector<ChoiceKey> keys;
};

// The goal among `candidates`; `cost` has one entry a candidate. The targets that a candidate sees now, after the
// filter, count by 1 - ahead_weight, and those that it is predicted to see by ahead_weight, in [0, 1]. The status
// (tracking, partial, escaping) depends on what it sees now: a prediction never replaces the real target. `desired_m`
// is only compared with the goal, for the reason. Candidates outside the limits are taken only when no other is left.
Choice choose_place(const CandidateSet& candidates, std::span<const TrackedTarget> targets,
                    std::span<const double> cost, const glm::dvec3& desired_m, double ahead_weight,
                    const MoveSettings& settings, const Reachable& reachable, ChoiceScratch& scratch);

// Strategy kBasic: choose_place with the distance to the desired position as cost. Usually looks only at the candidates
// near it.
Choice choose_basic(const CandidateSet& candidates, std::span<const TrackedTarget> targets, const glm::dvec3& desired_m,
                    double ahead_weight, const MoveSettings& settings, const Reachable& reachable,
                    ChoiceScratch& scratch);

}  // namespace sightline
