// The places at which a goal may be, and what a choice of one says.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "server/aggregate/candidates.h"
#include "server/base/camera.h"
#include "server/move/decision.h"
#include "server/move/shot.h"
#include "server/scene/target.h"
#include "server/settings/move_settings.h"

namespace sightline {

// Weighted centre of the steered targets, required and optional alike, world metres. At least one target must be
// steered.
glm::dvec3 weighted_center_m(std::span<const TrackedTarget> targets);

// The desired position: `offset_m` from the weighted centre, moved outwards until the whole group fits the picture
// (dolly), and clamped to the distance and elevation limits.
glm::dvec3 desired_place_m(std::span<const TrackedTarget> targets, const glm::dvec3& offset_m, const Lens& lens,
                           double framing_margin, const MoveSettings& settings);

// The angle of an offset above the horizontal.
double elevation_rad(const glm::dvec3& offset_m);

// The farthest position that the camera may take on the side of the targets that `offset_m` names: max_distance_m from
// the weighted centre, within the elevation limits.
glm::dvec3 farthest_place_m(std::span<const TrackedTarget> targets, const glm::dvec3& offset_m,
                            const MoveSettings& settings);

// Returns whether a position is within the distance and elevation limits.
bool within_limits(const glm::dvec3& place_m, std::span<const TrackedTarget> targets, const MoveSettings& settings);

// Which limits a position breaks by more than 1 mm or 0.001 rad. Neither without a steered target.
struct BrokenLimits {
  bool distance = false, elevation = false;
};
BrokenLimits broken_limits(const glm::dvec3& place_m, std::span<const TrackedTarget> targets,
                           const MoveSettings& settings);

// The same test as within_limits for many positions around the same targets, with the same results. A position that is
// too near to an elevation limit for the quick test is tested by within_limits.
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
  int candidate = -1;                      // index into the candidate set; -1: stay
  std::optional<glm::dvec3> place_m = {};  // where to go instead of the candidate's own place
};

// The steered targets: bit i is target i.
uint32_t steered_mask(std::span<const TrackedTarget> targets);

// The status of going to this candidate, by what is seen from it. The reason is left to reason_of (decision.h). Without
// targets the result is kHolding.
Choice choice_of(uint32_t candidate, const CandidateSet& candidates, std::span<const TrackedTarget> targets);

}  // namespace sightline
