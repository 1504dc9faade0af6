// How an instance turns, found from the rotations that a client sends without angular velocities.
//
// The angular velocity is what the last two changes of the rotation have in common, each over the time since the change
// before it. So noise, which turns to and fro, is no turn. A rotation may be held for several ticks, as physics at 30
// Hz gives it in ticks of 60 Hz; the rate then stays the same.
#pragma once

#include <glm/glm.hpp>
#include <glm/gtc/quaternion.hpp>

namespace sightline {

// A faster turn is a jump.
inline constexpr double kMostTurnRadps = 1000.0;

// A value type. Not thread-safe. Deterministic.
class TurnTrack {
 public:
  // Adds the rotation after dt_s > 0; `before` and `now` are world_from_instance, of unit length. Returns the angular
  // velocity in radians per second, world axes. It is zero until two changes have gone the same way round, after a
  // jump, and as soon as the rotation has stayed for longer than between the last two changes.
  glm::dvec3 observe(double dt_s, const glm::dquat& before, const glm::dquat& now);
  // The client sent the angular velocity with the newest rotation.
  void observe_sent() { *this = TurnTrack(), sent_ = true; }
  bool has_sent_rate() const { return sent_; }

 private:
  friend struct StateFields;  // lists its fields, to write and read them as bytes (server/session/state_fields.h)

  bool sent_ = false;
  bool turned_ = false;         // not so long ago that it has stopped
  double since_s_ = 0.0;        // since the last change
  double interval_s_ = 0.0;     // the time over which the last change came
  glm::dvec3 rate_radps_{0.0};  // of the last change
  glm::dvec3 turning_radps_{0.0};
};

}  // namespace sightline
