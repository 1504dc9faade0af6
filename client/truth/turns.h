// How soon a camera answers when its targets turn.
//
// A turn is a frame at which the targets' centre goes on in another direction. Its mean velocities over the
// kTurnWindowS before and after the frame are at more than kTurnRad to each other. Both are at least kTurnSpeedMps
// fast. If this is true of neighbouring frames, the frame with the greatest angle is the turn. The centre's change of
// velocity is the difference of the two.
//
// The camera answers at the first frame at which it has made half of that change. Its mean velocity over the
// kTurnWindowS around that frame then differs from the one before the turn by half of the change, measured along the
// change. A camera that moves exactly with its targets answers after 0 s. One that only looks round, since it sees well
// from where it is, does not answer; so this figure explains the others, and is no aim in itself.
#pragma once

#include <span>

#include "client/truth/judge.h"

namespace sightline {

inline constexpr double kTurnWindowS = 0.25;
inline constexpr double kTurnRad = 1.0471975511965976;  // 60 degrees
inline constexpr double kTurnSpeedMps = 0.5;
inline constexpr double kLongestAnswerS = 2.0;

struct TurnMetrics {
  // Turns that the camera answered, or had kLongestAnswerS to answer. Those near a declared jump of the camera are left
  // out.
  size_t turns = 0;
  double mean_answer_s = 0.0;  // from the turn to the answer; a turn without one counts as kLongestAnswerS
  size_t unanswered = 0;
};
// `centers_m`: the weighted centre of the targets at each frame; world, as long as `frames`. Frames are evenly spaced
// in time.
TurnMetrics answers_to_turns(std::span<const CameraFrame> frames, std::span<const glm::dvec3> centers_m);

}  // namespace sightline
