// Presets: whole sets of settings by name. A session starts from one and may change what it likes.
#pragma once

#include <string_view>

#include "server/step/step.h"

namespace sightline {

enum class Preset {
  kSightline,  // the default: what served best over all measured scenes
  kPaper,      // the method as printed, in the configuration that the paper found best
};

// kSightline: the defaults that the .proto files state. They are not those of a StepSettings{}, which is the plainest method: strategy
// Basic over the lattice, aim points alone, without filter, prediction or viewpoint search.
// kPaper: the sphere of n dt^2 a_max, one surface point of each target per tick in round robin, texel centres, pair volumes, the joint
// filter 6/10, RobustMove with a prediction of 300 ms.
StepSettings preset_settings(Preset preset);

std::string_view name_of(Preset preset);

// What the paper's tables compare: preset paper with a part of it changed.
// A row of Table 2: this strategy and prediction [0, 2] s (0: none), and no filter over time.
StepSettings paper_row(Strategy strategy, double prediction_s);
// A row of Table 3: Basic without prediction. A candidate is given the state that it had in at least `a` of the last `n` [1, 64]
// steps; 0/0: no filter.
StepSettings paper_stability(int a, int n);

}  // namespace sightline
