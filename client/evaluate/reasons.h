// Checks the reasons that a camera gives (server/move/decision.h) by rays in the true scene.
//
// Reasons speak of places: "all targets are visible from the position that keeps the shot", "no position in reach is
// known to see all targets". The camera knows these places by depth maps of low resolution. Here each place is looked
// at with kClaimRays rays to every target.
#pragma once

#include <map>
#include <optional>
#include <span>
#include <vector>

#include "client/ceiling/sight.h"
#include "client/truth/judge.h"
#include "server/step/step_dump.h"

namespace sightline {

inline constexpr size_t kClaimRays = 32;
// A claim counts as false only where it is clearly so. A target that is said to be seen needs a single free ray. A
// place that is said not to see it is overlooked if this share of the rays is free.
inline constexpr double kClearlySeen = 0.5;

// A reason, and the places that it speaks of.
struct ReasonClaim {
  MoveReason reason = MoveReason::kNoTargets;
  double time_s = 0.0;                // of the decision
  std::vector<uint64_t> target_ids;   // of the targets that the camera tries to show
  std::optional<glm::dvec3> place_m;  // where the camera goes; world
  std::vector<glm::dvec3> reach_m;    // all positions in reach; empty if the reason does not speak of them
};
// The claim of a step that decided; empty if its reason says nothing about places, or if it has no place. `time_s`: of
// the step. In reach are the candidates where a body of this radius fits.
std::optional<ReasonClaim> claim_of(const StepDump& dump, double time_s, double body_radius_m);

enum class Verdict { kHolds, kFalse };
// `sight` must have been refreshed at the claim's time.
Verdict check_claim(const ReasonClaim& claim, const ScenarioWorld& world, const SightEstimate& sight);

struct ReasonCount {
  size_t claims = 0, false_claims = 0;
};
// By reason. `claims` are in the order of time; a claim that follows itself counts once.
using ReasonCounts = std::map<MoveReason, ReasonCount>;
ReasonCounts check_reasons(ScenarioWorld& world, ExtentCache& extents, std::span<const ReasonClaim> claims);

// The place of the shot at one frame, and what the policy expects there (ShotReport).
struct AskedPlace {
  double time_s = 0.0;
  glm::dvec3 place_m{0.0};   // world
  uint64_t soon_target = 0;  // the target that is expected to be hidden from there; 0: none
  double soon_s = 0.0;       // when, from time_s on
};
inline constexpr double kAnnouncedWithinS = 0.2, kObstructionS = 0.2, kWarningS = 0.2;
// A target counts as hidden from the place if the ray to its aim point is blocked.
struct ObstructionCounts {
  size_t announced = 0;  // frames that expect a target to be hidden
  size_t came_true = 0;  // of these: it is hidden at that time, to within kAnnouncedWithinS
  size_t began = 0;      // times at which some target began to be hidden, and stayed so for kObstructionS
  // of these: a frame at least kWarningS before named the target and the time, to within kAnnouncedWithinS
  size_t began_announced = 0;
};
ObstructionCounts check_obstructions(ScenarioWorld& world, std::span<const AskedPlace> places);

}  // namespace sightline
