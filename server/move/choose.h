// Chooses the goal among the candidates (paper 3.4). The choice falls back in this order: candidates that see all targets, the best
// partial view by target weight (required before optional targets), escape, hold. Among candidates that see the same targets, the one
// of least cost wins; the strategies of the paper are different costs (see cost.h).
//
// The paper leaves open what the goal should be nearest to. Here it is the desired position, which keeps the shot while targets
// walk. If `follow` is kStay it is the camera's own position, as in the method as printed.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "server/aggregate/candidates.h"
#include "server/base/camera.h"
#include "server/move/coherence.h"
#include "server/move/cost.h"
#include "server/move/decision.h"
#include "server/move/shot.h"
#include "server/scene/target.h"
#include "server/settings/move_settings.h"

namespace sightline {

// Weighted centre of the steered targets, required and optional alike, world metres. At least one target must be steered.
glm::dvec3 weighted_center_m(std::span<const TrackedTarget> targets);

// The desired position: `offset_m` from the weighted centre, moved outwards until the whole group fits the picture (dolly), and clamped
// to the distance and elevation limits.
glm::dvec3 desired_place_m(std::span<const TrackedTarget> targets, const glm::dvec3& offset_m, const Lens& lens,
                           double framing_margin, const MoveSettings& settings);

// The angle of an offset above the horizontal.
double elevation_rad(const glm::dvec3& offset_m);

// The farthest position that the camera may take on the side of the targets that `offset_m` names: max_distance_m from the weighted
// centre, within the elevation limits.
glm::dvec3 farthest_place_m(std::span<const TrackedTarget> targets, const glm::dvec3& offset_m, const MoveSettings& settings);

// Returns whether a position is within the distance and elevation limits.
bool within_limits(const glm::dvec3& place_m, std::span<const TrackedTarget> targets,
                   const MoveSettings& settings);

// Which limits a position breaks by more than 1 mm or 0.001 rad. Neither without a steered target.
struct BrokenLimits {
  bool distance = false, elevation = false;
};
BrokenLimits broken_limits(const glm::dvec3& place_m, std::span<const TrackedTarget> targets,
                           const MoveSettings& settings);

// The same test as within_limits for many positions around the same targets, with the same results. A position that is too near to an elevation limit
// for the quick test is tested by within_limits.
class PlaceLimits {
 public:
  // At least one target must be steered. Both arguments must outlive the object.
  PlaceLimits(std::span<const TrackedTarget> targets, const MoveSettings& settings);
  bool hold(const glm::dvec3& place_m) const;

 private:
  std::span<const TrackedTarget> targets_;
  const MoveSettings& settings_;
  glm::dvec3 center_m_;
  glm::dvec2 low_, high_;  // cosine and sine of the least and greatest elevation
};

struct Choice {
  MoveStatus status = MoveStatus::kHolding;
  MoveReason reason = MoveReason::kNoTargets;
  int candidate = -1;  // index into the candidate set; -1: stay
};

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

// The goal among `candidates`; `cost` has one entry a candidate. The targets that a candidate sees now, after the filter, count by
// 1 - ahead_weight, and those that it is predicted to see by ahead_weight, in [0, 1]. The status (tracking, partial, escaping) depends on what it sees now: a
// prediction never replaces the real target. `desired_m` is only compared with the goal, for the reason. Candidates outside the limits
// are taken only when no other is left.
Choice choose_place(const CandidateSet& candidates, std::span<const TrackedTarget> targets,
                    std::span<const double> cost, const glm::dvec3& desired_m, double ahead_weight,
                    const MoveSettings& settings, const Reachable& reachable, ChoiceScratch& scratch);

// Status and reason of going to this candidate. For strategies whose cost includes what is hidden. Without targets the result
// is kHolding.
Choice choice_of(uint32_t candidate, const CandidateSet& candidates, std::span<const TrackedTarget> targets,
                 const glm::dvec3& desired_m);

// Strategy kBasic: choose_place with the distance to the desired position as cost. Usually looks only at the candidates near it.
Choice choose_basic(const CandidateSet& candidates, std::span<const TrackedTarget> targets,
                    const glm::dvec3& desired_m, double ahead_weight, const MoveSettings& settings,
                    const Reachable& reachable, ChoiceScratch& scratch);

}  // namespace sightline
