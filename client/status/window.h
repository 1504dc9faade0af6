// Work of a daemon between two readings of its counters.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "sightline/v1/camera_control.pb.h"

namespace sightline {

// A quantile of a histogram, q in [0, 1], in microseconds. Durations count as spread evenly over their octave, so the
// result can be wrong by up to half of itself. 0 when nothing was counted.
double quantile_us(const v1::DurationHistogram& histogram, double q);

// The durations that `later` counts and `earlier` does not.
v1::DurationHistogram difference(const v1::DurationHistogram& later, const v1::DurationHistogram& earlier);

struct DurationRow {
  std::string name;
  uint64_t count = 0;
  double p50_us = 0.0, p99_us = 0.0, mean_us = 0.0;
};

// What cameras showed, as shares, [0, 1]. A share of no time is 0.
struct CameraShares {
  double seconds = 0.0;                               // time of the game, over all cameras that had targets
  double tracking = 0.0, partial = 0.0, blind = 0.0;  // of it, by what was seen: all targets, not all, nothing
  double target_seconds = 0.0;                        // time, times the number of targets
  double shown = 0.0;                                 // of the targets, in the mean
  double shot_seconds = 0.0;                          // time of the game with a shot
  double worth = 0.0;                                 // of the pictures of a shot, in the mean
  double shot_kept = 0.0;                             // of the time with a shot
  uint64_t cuts = 0;
};
// A default `earlier` gives the shares of `later` itself.
CameraShares camera_shares(const v1::CameraFigures& earlier, const v1::CameraFigures& later);

struct Window {
  double seconds = 0.0;  // > 0
  double ticks_per_s = 0.0, steps_per_s = 0.0, merged_per_s = 0.0, refused_per_s = 0.0;
  double late_share = 0.0, degraded_share = 0.0;  // of the steps, [0, 1]
  double received_bytes_per_s = 0.0, sent_bytes_per_s = 0.0;
  double cpus = 0.0;  // processors that the daemon kept busy
  CameraShares cameras;
  std::vector<DurationRow> durations;  // tick age, queue, step, then the stages
};

// `later` must come from the same run of the daemon. A default `earlier` gives the window since its start.
Window window_between(const v1::GetServerStatsResponse& earlier, const v1::GetServerStatsResponse& later);

}  // namespace sightline
