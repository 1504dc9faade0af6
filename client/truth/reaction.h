// How soon a camera answers to an occlusion that lasts (design 9): the figure that keeps a camera which never
// moves from winning by its stability.
//
// At a frame at which the straight line from the camera to a target's aim point becomes blocked, the
// occlusion is lasting when it would stay blocked for kLastingS had the camera kept its offset (world axes)
// from the targets' centre from then on; momentary ones are passed over. The reaction is the first later
// frame at which the camera's velocity relative to the targets' centre differs by more than kReactionMps from
// what it was before the onset, or at which the target is seen again. A camera at rest with 10 m/s^2 takes
// 0.025 s to reach that difference.
#pragma once

#include <span>
#include <vector>

#include "client/truth/judge.h"

namespace sightline {

inline constexpr double kLastingS = 0.5;
inline constexpr double kReactionMps = 0.25;
inline constexpr double kLongestReactionS = 2.0;

struct ReactionMetrics {
  size_t occlusions = 0;         // lasting ones, over all targets; none counts that the run's end cuts short
  std::vector<double> delays_s;  // of each, targets in their order; the two below are of these
  double mean_delay_s = 0.0;  // one without any answer counts with kLongestReactionS, or up to the run's end
  double p95_delay_s = 0.0;
  size_t unanswered = 0;
  // From the onset until the line to the aim point is free again, or to the run's end.
  double mean_regain_s = 0.0;
};

// `world` must have a target; its time is left anywhere.
ReactionMetrics measure_reaction(ScenarioWorld& world, std::span<const CameraFrame> frames);

}  // namespace sightline
