// When the camera changes from one course to another that costs less.
//
// The costs of two courses change from step to step by noise that is larger than most differences between them. So the
// camera changes when what it would gain, summed over time, is enough. That takes one to three steps where all sight is
// about to be lost, 0.2 s for a gain of 3 m, and 2 s for one of 0.3 m. Gains and losses that alternate nearly cancel
// each other. This is the cumulative sum test of Page (Continuous Inspection Schemes, 1954), with nothing taken off at
// each step.
#pragma once

#include <algorithm>

namespace sightline {

// A value type. Deterministic. Not thread-safe.
struct SummedGain {
  static constexpr double kEnoughMetreSeconds = 0.6;

  double sum_metre_s = 0.0;  // metres of cost times seconds, [0, kEnoughMetreSeconds]

  // Adds what a change would gain now, in metres of cost, over a step of step_s >= 0. `gain_m` is negative where the
  // change would lose, and may be infinite. Returns whether the camera should change. The sum then begins again.
  bool add(double gain_m, double step_s) {
    sum_metre_s = std::max(0.0, sum_metre_s + gain_m * step_s);
    const bool is_enough = sum_metre_s > kEnoughMetreSeconds;
    if (is_enough) sum_metre_s = 0.0;
    return is_enough;
  }
};

}  // namespace sightline
