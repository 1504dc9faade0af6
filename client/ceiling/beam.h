// Searches for the best motion that obeys all limits. It is a beam search. At each step of time it keeps the most
// promising camera states, at most one for each cell of place and velocity. Every state was reached by motion that
// keeps the limits exactly. The search knows what is ahead from the guide, a dynamic program over a grid.
#pragma once

#include <vector>

#include "client/ceiling/guide.h"
#include "client/ceiling/timeline.h"
#include "client/scenario/scenario_world.h"
#include "server/move/motion.h"
#include "server/sample/extent.h"
#include "server/settings/camera_limits.h"
#include "server/settings/move_settings.h"

namespace sightline {

// The cost of a body that touches a collider. More than any plan costs otherwise.
inline constexpr double kTouchCost = 1e5;

struct BeamOptions {
  PlanAim aim = PlanAim::kJoint;
  size_t width = 400;  // states that are kept after each step
  size_t tried = 800;  // states that are played exactly in each step
  // stages whose pictures are always taken as the judge takes them; may be shorter than the plan
  std::vector<bool> careful_stages;
};

struct BeamResult {
  std::vector<Pose> path;  // by tick
  double cost = 0.0;       // by the search's own pictures, which are coarser than the judge's
};

// `start` is the camera at tick 0, at rest. Where no way leads on, such as from inside a wall, the camera stops at once
// and stays. Deterministic. Moves the time of `world`.
BeamResult search_beam(ScenarioWorld& world, ExtentCache& extents, const Pose& start, const Guide& guide,
                       const Timeline& timeline, const CameraLimits& limits, const MoveSettings& place_limits,
                       const BeamOptions& options);

}  // namespace sightline
