// The plainest of the baselines (design 9): a camera that follows with a fixed offset and avoids nothing.
#pragma once

#include <span>
#include <vector>

#include "client/judge.h"
#include "client/scenario_world.h"

namespace sightline {

// The camera keeps the offset (world axes) from the targets' weighted centre that it has at the start and
// looks at that centre, at the times of `frames` and with their lenses; no limits, no smoothing. `world` must
// have a target and is left at the last time.
std::vector<CameraFrame> follow_path(ScenarioWorld& world, std::span<const CameraFrame> frames);

}  // namespace sightline
