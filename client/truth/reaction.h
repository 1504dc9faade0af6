// How soon a camera reacts to a sustained occlusion (design 9). Without this figure, a camera that never moves would
// win by its stability.
//
// An occlusion begins at a frame at which the straight line from the camera to a target's aim point becomes blocked. It
// is sustained when the line would stay blocked for kSustainedS if the camera kept its offset (world axes) from the
// targets' centre. Shorter ones are not counted. The camera has reacted at the first later frame at which the target is
// visible again, or at which the camera has changed its velocity. That is a difference of more than kReactionMps in the
// velocity relative to the targets' centre, compared with the time before the onset. A camera at rest that accelerates
// at 10 m/s^2 reaches that difference after 0.025 s.
#pragma once

#include <span>
#include <vector>

#include "client/truth/judge.h"

namespace sightline {

inline constexpr double kSustainedS = 0.5;
inline constexpr double kReactionMps = 0.25;
inline constexpr double kLongestReactionS = 2.0;

struct ReactionMetrics {
  // sustained ones, of all targets; an occlusion that the end of the run cuts short is not counted
  size_t occlusions = 0;
  // one each; without a reaction: kLongestReactionS, or the time left until the end of the run
  std::vector<double> delays_s;
  double mean_delay_s = 0.0;
  double p95_delay_s = 0.0;
  size_t unanswered = 0;  // occlusions without a reaction
  // from the onset until the line to the aim point is free again, or until the end of the run
  double mean_regain_s = 0.0;
};

// `world` must have a target; its time is left anywhere.
ReactionMetrics measure_reaction(ScenarioWorld& world, std::span<const CameraFrame> frames);

}  // namespace sightline
