#include "server/session/turn_track.h"

#include <cmath>

namespace sightline {
namespace {

// A rotation that stays for so many times the last interval has stopped. Held rotations come in uneven intervals.
constexpr double kStopsAfter = 1.6;
// After a first change, the next one may come this late, seconds: rotations are held for as long at 10 Hz.
constexpr double kFirstIntervalS = 0.11;
// Smaller turns are rounding.
constexpr double kLeastTurnRad = 1e-7;

// The turn from one rotation to another the shorter way round: along its axis, as long as its angle; world axes.
glm::dvec3 turn_between(const glm::dquat& before, const glm::dquat& now) {
  glm::dquat turn = now * glm::conjugate(before);
  if (turn.w < 0) turn = -turn;
  const glm::dvec3 axis(turn.x, turn.y, turn.z);
  const double sine = glm::length(axis);
  return sine > 0 ? axis * (2 * std::atan2(sine, turn.w) / sine) : axis;
}

}  // namespace

glm::dvec3 TurnTrack::observe(double dt_s, const glm::dquat& before, const glm::dquat& now) {
  sent_ = false;
  since_s_ += dt_s;
  const glm::dvec3 turn_rad = turn_between(before, now);
  if (glm::length(turn_rad) < kLeastTurnRad) {
    const double most_s = turning_radps_ == glm::dvec3(0.0) ? kFirstIntervalS : interval_s_;
    if (since_s_ > kStopsAfter * most_s) turned_ = false, turning_radps_ = rate_radps_ = glm::dvec3(0.0);
    return turning_radps_;
  }
  interval_s_ = turned_ ? since_s_ : dt_s;
  const glm::dvec3 rate_radps = turn_rad / interval_s_;
  if (!(glm::length(rate_radps) <= kMostTurnRadps)) return *this = TurnTrack(), glm::dvec3(0.0);
  const bool agree = turned_ && glm::dot(rate_radps, rate_radps_) > 0;
  turning_radps_ = !agree                                               ? glm::dvec3(0.0)
                   : glm::length(rate_radps) < glm::length(rate_radps_) ? rate_radps
                                                                        : rate_radps_;
  rate_radps_ = rate_radps;
  since_s_ = 0.0, turned_ = true;
  return turning_radps_;
}

}  // namespace sightline
