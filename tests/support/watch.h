// Steps a world and checks the invariants of every step.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/support/world.h"

namespace sightline::test {

inline bool is_sound(const StepResult& r) {
  return is_finite(r.camera.pose.position_m) && is_finite(r.camera.pose.rotation) && is_finite(r.camera.velocity_mps) &&
         is_finite(r.camera.angular_velocity_radps) && std::abs(glm::length(r.camera.pose.rotation) - 1) < 1e-9;
}

// Yaw and pitch, radians, of a camera without roll. Past a pole the pitch is beyond +-pi/2, since the camera is upside
// down there.
inline glm::dvec2 yaw_and_pitch(const glm::dquat& world_from_camera) {
  const glm::dvec3 right = world_from_camera * glm::dvec3(1, 0, 0);
  const double sine = (world_from_camera * glm::dvec3(0, 0, -1)).y;
  return {std::atan2(-right.z, right.x), std::atan2(sine, (world_from_camera * glm::dvec3(0, 1, 0)).y)};
}

// Steps and checks that the path is finite, within the limits, without a jump and never upside down.
class Watch {
 public:
  explicit Watch(World& world) : world_(world), last_(world.camera()) {}
  bool may_lean = false;  // a shot with a roll was asked for: only the speed of the turn is checked
  StepResult step(double dt = 1.0 / 60) {
    const StepResult r = world_.step(dt);
    EXPECT_TRUE(is_sound(r));
    const double moved_s = std::min(dt, kMaxStepS);
    const glm::dvec3 velocity = moved_s > 0 ? (r.camera.pose.position_m - last_.pose.position_m) / moved_s
                                            : last_.velocity_mps;
    EXPECT_LE(glm::length(velocity), world_.limits.max_speed_mps * (1 + 1e-6));
    EXPECT_LE(glm::length(velocity - last_.velocity_mps),
              world_.limits.max_acceleration_mps2 * moved_s * (1 + 1e-6) + 1e-9);
    EXPECT_LE(angle_between(last_.pose.rotation, r.camera.pose.rotation),
              world_.limits.max_angular_speed_radps * moved_s * (1 + 1e-6) + 1e-7);
    if (!may_lean) check_turn(r.camera.pose.rotation, moved_s);
    last_ = r.camera;
    return r;
  }

 private:
  void check_turn(const glm::dquat& rotation, double moved_s) {
    EXPECT_GE((rotation * glm::dvec3(0, 1, 0)).y, 0) << "upside down at tick " << world_.tick;
    EXPECT_NEAR((rotation * glm::dvec3(1, 0, 0)).y, 0, 1e-9) << "rolled at tick " << world_.tick;
    if (moved_s <= 0) return;
    const glm::dvec2 turned = yaw_and_pitch(rotation) - yaw_and_pitch(last_.pose.rotation);
    const glm::dvec2 rate = glm::dvec2(std::remainder(turned.x, 2 * std::acos(-1.0)), turned.y) / moved_s;
    EXPECT_LE(glm::length(rate), world_.limits.max_angular_speed_radps * (1 + 1e-6) + 1e-9);
    EXPECT_LE(glm::length(rate - last_rate_),
              world_.limits.max_angular_acceleration_radps2 * moved_s * (1 + 1e-6) + 1e-9);
    last_rate_ = rate;
  }

  World& world_;
  CameraState last_;
  glm::dvec2 last_rate_{0.0};  // of yaw and pitch, radians per second; a world is watched from rest
};

}  // namespace sightline::test
