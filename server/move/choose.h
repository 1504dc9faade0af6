// Choose: the goal among the candidates (paper 3.4), with the ordered fallbacks of design 6: S_V, then the best partial view by
// target weight (required before optional), then escape, then hold. Among candidates that see the same, the one of least cost
// is taken; the strategies of the paper are ways to set that cost (see cost.h).
//
// What the paper leaves open is nearest to *what*. Here: to the desired place, which is the place that keeps the shot when
// targets walk, and the camera's own place when `follow` is kStay (the method as printed).
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
#include "server/move/target_view.h"
#include "server/scene/target.h"
#include "server/settings/move_settings.h"

namespace sightline {

// Weighted centre of the steered targets; required and optional alike. Must have at least one.
glm::dvec3 weighted_center_m(std::span<const TargetView> targets);

// The place that the camera wants: `offset_m` from the weighted centre, pushed outwards until the whole group fits the
// picture (dolly), clamped to the distance and elevation limits.
glm::dvec3 desired_place_m(std::span<const TargetView> targets, const glm::dvec3& offset_m, const Lens& lens,
                           double framing_margin, const MoveSettings& settings);

// A place the camera may not want by the distance or elevation limits.
bool within_limits(const glm::dvec3& place_m, std::span<const TargetView> targets,
                   const MoveSettings& settings);

// The same for many places of the same targets, which are looked at once. Exact: a place so near to a limit of elevation that the
// quick test cannot tell is tested as above.
class PlaceLimits {
 public:
  // At least one target is steered; both must outlive it.
  PlaceLimits(std::span<const TargetView> targets, const MoveSettings& settings);
  bool hold(const glm::dvec3& place_m) const;

 private:
  std::span<const TargetView> targets_;
  const MoveSettings& settings_;
  glm::dvec3 center_m_;
  glm::dvec2 low_, high_;  // cosine and sine of the least and greatest elevation
};

struct Choice {
  MoveStatus status = MoveStatus::kHolding;
  MoveReason reason = MoveReason::kNoTargets;
  int candidate = -1;  // index into the set, or -1: stay
};

// True when the camera body can go straight to a place.
using Reachable = std::function<bool(const glm::dvec3& place_m)>;

// At most this many places of one set are tested for reachability, nearest first: it bounds the cost of a step.
inline constexpr int kMaxReachTests = 24;

// By what candidates are ordered, and the memory for it, reused.
struct ChoiceKey {
  double required = 0, optional = 0;  // weights of the targets seen
  double cost = 0;
  glm::dvec3 place_m{0.0};
  uint32_t candidate = 0;
  bool within_limits = false;
};
struct ChoiceScratch {
  std::vector<ChoiceKey> keys;
};

// The goal among `candidates`. `cost` runs parallel to them. What a candidate sees is what the filter says now and what is
// predicted, weighed by 1 - ahead_weight and ahead_weight, [0, 1]; a state (tracking, partial, escaping) is by what it sees
// now: a prediction never replaces the real target. `desired_m` only tells whether the goal is the desired place itself.
// Candidates outside the limits are taken only when none inside is left.
Choice choose_place(const CandidateSet& candidates, std::span<const TargetView> targets,
                    std::span<const double> cost, const glm::dvec3& desired_m, double ahead_weight,
                    const MoveSettings& settings, const Reachable& reachable, ChoiceScratch& scratch);

// What it means to go to this candidate, whatever it sees: for goals whose costs hold what is hidden. Holds without targets.
Choice choice_of(uint32_t candidate, const CandidateSet& candidates, std::span<const TargetView> targets,
                 const glm::dvec3& desired_m);

// Basic alone: choose_place by the distance to the desired place, without looking at all candidates where those near it do.
Choice choose_basic(const CandidateSet& candidates, std::span<const TargetView> targets,
                    const glm::dvec3& desired_m, double ahead_weight, const MoveSettings& settings,
                    const Reachable& reachable, ChoiceScratch& scratch);

}  // namespace sightline
