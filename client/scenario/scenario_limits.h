// The limits that a scenario is made for: `max_speed_mps` and `max_acceleration_mps2` in extras.sightline of its camera
// node.
#pragma once

#include "client/scenario/scenario.h"
#include "server/settings/camera_limits.h"

namespace sightline {

// The default limits, overridden by the limits of the scenario. kInvalidArgument: a limit is not a number or out of its
// range. The field is "nodes[camera].extras.sightline.max_speed_mps".
Result<CameraLimits> limits_of(const Scenario& scenario);

}  // namespace sightline
