// Steps a world and checks what holds at every step, whatever happens in it.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/support/world.h"

namespace sightline::test {

inline bool is_sound(const StepResult& r) {
  return is_finite(r.camera.pose.position_m) && is_finite(r.camera.pose.rotation) &&
         is_finite(r.camera.velocity_mps) && is_finite(r.camera.angular_velocity_radps) &&
         std::abs(glm::length(r.camera.pose.rotation) - 1) < 1e-9;
}

// Steps and checks that the path is finite, within the limits, and without a jump.
class Watch {
 public:
  explicit Watch(World& world) : world_(world), last_(world.camera()) {}
  StepResult step(double dt = 1.0 / 60) {
    const StepResult r = world_.step(dt);
    EXPECT_TRUE(is_sound(r));
    const double moved_s = std::min(dt, kMaxStepS);
    const glm::dvec3 velocity =
        moved_s > 0 ? (r.camera.pose.position_m - last_.pose.position_m) / moved_s : last_.velocity_mps;
    EXPECT_LE(glm::length(velocity), world_.limits.max_speed_mps * (1 + 1e-6));
    EXPECT_LE(glm::length(velocity - last_.velocity_mps),
              world_.limits.max_acceleration_mps2 * moved_s * (1 + 1e-6) + 1e-9);
    EXPECT_LE(angle_between(last_.pose.rotation, r.camera.pose.rotation),
              world_.limits.max_angular_speed_radps * moved_s * (1 + 1e-6) + 1e-7);
    last_ = r.camera;
    return r;
  }

 private:
  World& world_;
  CameraState last_;
};

}  // namespace sightline::test
