// The times of a plan, and what it pays for.
#pragma once

#include <cstddef>

#include "server/settings/camera_limits.h"

namespace sightline {

// Tick k is at k tick_s. Every ticks_per_stage-th tick is a stage, at which a picture counts.
struct Timeline {
  double tick_s = 1.0 / 60.0;
  size_t ticks = 1;            // >= 1
  size_t ticks_per_stage = 6;  // >= 1
  size_t stages() const { return (ticks - 1) / ticks_per_stage + 1; }
  double tick_time_s(size_t tick) const { return static_cast<double>(tick) * tick_s; }
  double stage_s() const { return static_cast<double>(ticks_per_stage) * tick_s; }
};

// A step of a plan: the camera's acceleration is constant for this many stages.
inline constexpr size_t kStagesPerStep = 2;

// The quantity that a plan makes as large as it can.
enum class PlanAim {
  kJoint,  // pictures that show all targets
  kWorth,  // what its pictures are worth: the first picture's shot, with everybody whole (client/truth/coherence.h)
};

// The costs of a plan for kJoint, in pictures. A plan for kWorth pays 1 - worth for each picture, and the same for its
// way. The weights are so small that no sum of them over a plan reaches one picture. So a path that shows all targets
// in more pictures is always better. Of equal ones the greater visible share wins, then the shorter path.
struct PlanCosts {
  double hidden_share = 0.0;  // of a picture in which the mean visible share is 0; it also costs 1
  double per_m = 0.0;         // of a metre of path

  static PlanCosts of(const Timeline& timeline, const CameraLimits& limits) {
    const auto stages = static_cast<double>(timeline.stages());
    const double longest_m = limits.max_speed_mps * static_cast<double>(timeline.ticks) * timeline.tick_s;
    return {.hidden_share = 0.5 / stages, .per_m = longest_m > 0 ? 0.4 / longest_m : 0.0};
  }
  double picture(bool shows_all, double mean_share) const {
    return shows_all ? 0.0 : 1 + hidden_share * (1 - mean_share);
  }
};

}  // namespace sightline
