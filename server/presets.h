// Presets: whole sets of settings by name. A session starts from one and may change what it likes.
#pragma once

#include <string_view>

#include "server/step.h"

namespace sightline {

enum class Preset {
  kSightline,  // the default: what served best over all measured scenes
  kPaper,      // the method as printed, in the configuration that the paper found best
};

// sightline: see the defaults of each setting.
// paper: the sphere of n dt^2 a_max, one surface point a target and tick in round robin, texel centres, pair volumes, the joint
// filter 6/10, RobustMove with a prediction of 300 ms.
StepSettings preset_settings(Preset preset);

std::string_view name_of(Preset preset);

}  // namespace sightline
