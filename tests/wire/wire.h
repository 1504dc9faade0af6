// An opening and a tick as messages, valid in every field, for tests to change.
#pragma once

#include "sightline/v1/camera_control.pb.h"

namespace sightline::test {

inline void set(v1::Vec3* v, double x, double y, double z) {
  v->set_x(x), v->set_y(y), v->set_z(z);
}

inline void add_capsule(v1::OpenSession& open, uint64_t id, double x, double y, double z) {
  v1::NewInstance& instance = *open.add_instances();
  instance.set_id(id);
  instance.mutable_shape()->mutable_capsule()->set_radius(0.3);
  instance.mutable_shape()->mutable_capsule()->set_half_height(0.6);
  set(instance.mutable_pose()->mutable_position(), x, y, z);
}

// Two people, 1 and 2; the camera 6 m before them, in glTF's frame.
inline v1::OpenSession make_open() {
  v1::OpenSession open;
  add_capsule(open, 1, -1, 1, 0);
  add_capsule(open, 2, 1, 1, 0);
  open.add_targets()->set_id(1);
  open.add_targets()->set_id(2);
  set(open.mutable_camera()->mutable_position(), 0, 1.6, 6);
  return open;
}

// Tick `sequence` at 64 Hz. Both people keep their rotation and walk at 1 m/s.
inline v1::Tick make_tick(uint64_t sequence) {
  v1::Tick tick;
  tick.set_sequence(sequence);
  tick.set_time_s(static_cast<double>(sequence) / 64);
  v1::Transforms& t = *tick.mutable_transforms();
  for (const uint64_t id : {1, 2}) {
    t.add_ids(id);
    for (const double p : {id == 1 ? -1.0 : 1.0, 1.0, 0.0}) t.add_positions(p);
    for (const float r : {0.0f, 0.0f, 0.0f, 1.0f}) t.add_rotations(r);
    for (const float v : {1.0f, 0.0f, 0.0f}) t.add_velocities(v);
  }
  return tick;
}

}  // namespace sightline::test
