// The path of the camera over the last half second, with which an observed camera is compared (ObservedCamera in
// session.proto). Positions and rotations are kept apart, because either may begin again without the other.
#pragma once

#include <glm/glm.hpp>

#include "server/base/inline_vector.h"
#include "server/base/transform.h"

namespace sightline {

// The values of the last kKeptS seconds, and the straight way between them. A value type that never allocates.
template <typename Value>
class RecentTrack {
 public:
  static constexpr double kKeptS = 0.5;

  // Begins again with one value.
  void start(const Value& value);
  // Adds the value `dt_s` seconds after the newest one; without a lapse of time it is taken to be the same. Values
  // closer than kApartS in time replace each other; the newest one is always kept.
  void pass(const Value& value, double dt_s);

  size_t count() const { return entries_.size(); }
  const Value& operator[](size_t i) const { return entries_[i].value; }  // oldest first

 private:
  friend struct StateFields;  // lists its fields, to write and read them as bytes (server/session/state_fields.h)
  static constexpr double kApartS = 1.0 / 64;
  static constexpr size_t kMost = 40;  // more than kKeptS / kApartS, the newest and one older than kKeptS
  struct Entry {
    Value value{};
    double age_s = 0.0;
  };
  void drop_old();

  InlineVector<Entry, kMost> entries_;
};

struct SuggestedPath {
  RecentTrack<glm::dvec3> position_m;
  RecentTrack<glm::dquat> rotation;

  void start(const Pose& pose) { position_m.start(pose.position_m), rotation.start(pose.rotation); }
  void pass(const Pose& pose, double dt_s) {
    position_m.pass(pose.position_m, dt_s), rotation.pass(pose.rotation, dt_s);
  }
};

// The vector from the nearest point of the track to a position; the track must not be empty.
glm::dvec3 away_from(const RecentTrack<glm::dvec3>& track, const glm::dvec3& position_m);
// The angle in radians between a rotation and the nearest one of the track, which must not be empty.
double angle_from(const RecentTrack<glm::dquat>& track, const glm::dquat& rotation);

}  // namespace sightline
