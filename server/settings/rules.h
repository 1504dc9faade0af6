// Rules that hold between several settings of a group; ranges of single settings are in the .proto files. The generated
// `validate` of a group calls `check_rules` after its ranges. Paper 3.4 and 6.2 for the weights.
#pragma once

#include "server/settings/camera_limits.h"
#include "server/settings/step_settings.h"

namespace sightline {

// Most groups have none.
template <typename Group>
Status check_rules(const Group&) {
  return {};
}

// At least one of occlusion, distance and route is above 0: otherwise all candidates cost the same.
Status check_rules(const CostWeights& weights);
// The greatest distance is no tiny number, although the least one may be 0.
Status check_rules(const MoveSettings& settings);
// A zoom range has both ends or none.
Status check_rules(const FramingSettings& settings);

}  // namespace sightline
