// The settings of the paper's tables: the preset PAPER (server/settings/) with a part of it changed.
#pragma once

#include "server/settings/step_settings.h"

namespace sightline {

// A row of Table 2: this strategy and prediction [0, 2] s (0: none), and no filter over time.
StepSettings paper_row(Strategy strategy, double prediction_s);
// The same of RobustMove with its goal as printed, RobustGoal::kCenter.
StepSettings center_row(double prediction_s);
// A row of Table 3: Basic without prediction. A candidate is given the state that it had in at least `a` of the last
// `n` [1, 64] steps; 0/0: no filter.
StepSettings paper_stability(int a, int n);
// The same for the scene fence-agile, whose camera may accelerate by 1000 m/s^2. The bound's radius is n dt^2 a. With n
// = 3 instead of 300 it is as large as in the other scenes.
StepSettings agile_stability(int a, int n);

}  // namespace sightline
