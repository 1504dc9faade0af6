#include "server/move/motion.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "server/base/random.h"

namespace sightline {
namespace {

constexpr double kPi = std::numbers::pi;

// Jumps of the goal, irregular steps, pauses and gaps: the finite differences of the path never exceed the limits.
TEST(Motion, PathObeysTheLimitsWhateverTheGoalAndTheTimeStepDo) {
  CounterRandom random(41, 0, RandomPurpose::kTest);
  for (const double jerk : {0.0, 5.0, 60.0, 1000.0}) {
    const CameraLimits limits{.max_speed_mps = 4, .max_acceleration_mps2 = 7, .max_jerk_mps3 = jerk};
    CameraState camera;
    glm::dvec3 goal(0), last_velocity(0), last_acceleration(0);
    double fastest = 0;
    for (int step = 0; step < 20000; ++step) {
      if (random.next_below(20) == 0)
        goal = {random.next_in(-30, 30), random.next_in(-30, 30), random.next_in(-30, 30)};
      const double dt = random.next_below(50) == 0 ? 0.25 : random.next_in(0.001, 0.05);
      const glm::dvec3 velocity = velocity_towards(camera, goal, {1, 0, -2}, limits, dt);
      const glm::dvec3 acceleration = (velocity - last_velocity) / dt;
      EXPECT_LE(glm::length(velocity), 4 * (1 + 1e-8));
      EXPECT_LE(glm::length(acceleration), 7 * (1 + 1e-9));
      if (jerk > 0) {
        EXPECT_LE(glm::length(acceleration - last_acceleration) / dt, jerk * (1 + 1e-6)) << "step " << step;
      }
      camera = moved(camera, velocity, dt);
      last_velocity = velocity, last_acceleration = acceleration;
      fastest = std::max(fastest, glm::length(velocity));
    }
    EXPECT_GT(fastest, 3.9) << jerk;
  }
}

// Limits can be lowered below the camera's present speed.
TEST(Motion, ASpeedOverItsLimitIsBrakedWithinTheAcceleration) {
  CounterRandom random(43, 0, RandomPurpose::kTest);
  const auto within = [&](double most) {
    return glm::dvec3(random.next_in(-most, most), random.next_in(-most, most), random.next_in(-most, most));
  };
  for (int trial = 0; trial < 5000; ++trial) {
    CameraLimits limits{
        .max_speed_mps = random.next_in(0.1, 5), .max_acceleration_mps2 = random.next_in(1, 20), .max_jerk_mps3 = 0};
    limits.max_angular_speed_radps = limits.max_speed_mps;
    limits.max_angular_acceleration_radps2 = limits.max_acceleration_mps2;
    const double dt = random.next_in(0.001, 0.25), change = limits.max_acceleration_mps2 * dt;
    const glm::dvec3 before = within(10);
    const glm::dvec3 after = clamp_velocity(before, within(10), limits, dt);
    EXPECT_LE(glm::distance(before, after), change * (1 + 1e-9));
    EXPECT_LE(glm::length(after), std::max(limits.max_speed_mps, glm::length(before) - change) * (1 + 1e-9));

    // A pitch rate at which the camera need not yet brake for the pole; such braking would come first.
    const double stops = -change + std::sqrt(change * change + 2 * limits.max_acceleration_mps2);
    const glm::dvec2 former(before.x, std::clamp(before.y, -stops, stops));
    const TurnState turning{{0.3, -0.2, 0.0}, former.x, former.y};
    const TurnState turned = turn_towards(turning, {before.z, 0.4, 0.0}, limits, 0.4, dt);
    const glm::dvec2 rate(turned.yaw_rate_radps, turned.pitch_rate_radps);
    EXPECT_LE(glm::distance(rate, former), change * (1 + 1e-9));
    EXPECT_LE(glm::length(rate), std::max(limits.max_angular_speed_radps, glm::length(former) - change) * (1 + 1e-9));
  }
}

TEST(Motion, ArrivesAtAFixedGoalWithoutOvershoot) {
  for (const double jerk : {0.0, 100.0})
    for (const double dt : {0.004, 0.016, 0.1}) {
      const CameraLimits limits{.max_jerk_mps3 = jerk};
      // The acceleration of the last few centimetres fades no faster than its limit.
      const double over_m = jerk > 0 ? 1e-3 : 1e-9;
      CameraState camera;
      const glm::dvec3 goal(3, 0, 0);
      for (double t = 0; t < 5; t += dt) {
        camera = moved(camera, velocity_towards(camera, goal, {}, limits, dt), dt);
        EXPECT_LE(camera.pose.position_m.x, 3.0 + over_m) << dt;
      }
      EXPECT_NEAR(camera.pose.position_m.x, 3.0, 1e-3) << dt;
    }
}

// The wanted velocity is reached as soon as a plain one-dimensional profile of limited jerk reaches it, and not passed.
TEST(Motion, SettlesAtTheWantedVelocityInTheTimeThatTheJerkNeeds) {
  for (const double change_mps : {0.2, 0.9, 4.0, 9.5}) {
    const CameraLimits limits{.max_acceleration_mps2 = 10, .max_jerk_mps3 = 100};
    const double peak = std::min(10.0, std::sqrt(100.0 * change_mps));
    const double needs_s = change_mps / peak + peak / 100.0, dt = 0.002;
    CameraState camera;
    double reached_s = 0;
    for (double t = 0; t < 3; t += dt) {
      camera = moved(camera, steer_velocity(camera, {0, change_mps, 0}, limits, 0.0, dt), dt);
      EXPECT_LE(camera.velocity_mps.y, change_mps + 1e-9);
      if (camera.velocity_mps.y < 0.99 * change_mps) reached_s = t;
    }
    EXPECT_NEAR(reached_s, needs_s, 0.1 * needs_s + 5 * dt) << change_mps;
  }
}

TEST(Motion, KeepsStationWithAMovingGoal) {
  CameraState camera;
  glm::dvec3 goal(2, 0, 0);
  const glm::dvec3 walk(1.5, 0, 0.5);
  for (int step = 0; step < 600; ++step, goal += walk / 60.0) {
    camera = moved(camera, velocity_towards(camera, goal, walk, {}, 1.0 / 60), 1.0 / 60);
  }
  EXPECT_LT(glm::distance(camera.pose.position_m, goal), 0.05);
}

TEST(Motion, DiscreteBrakeStopsWithinTheBrakingDistance) {
  CounterRandom random(42, 0, RandomPurpose::kTest);
  for (int trial = 0; trial < 1000; ++trial) {
    CameraState camera;
    camera.velocity_mps = {random.next_in(0, 10), random.next_in(0, 1), 0};
    const double allowed = braking_distance_m(camera.velocity_mps, {});
    while (glm::length(camera.velocity_mps) > 0) {
      const double dt = random.next_in(0.001, 0.25);
      camera.velocity_mps = clamp_velocity(camera.velocity_mps, {}, {}, dt);
      camera.pose.position_m += camera.velocity_mps * dt;
    }
    EXPECT_LE(glm::length(camera.pose.position_m), allowed * (1 + 1e-9));
  }
}

TEST(Motion, AnglesAndRotationsAreInverse) {
  CounterRandom random(43, 0, RandomPurpose::kTest);
  for (int trial = 0; trial < 1000; ++trial) {
    const ViewAngles angles{random.next_in(-3.1, 3.1), random.next_in(-1.5, 1.5), random.next_in(-1, 1)};
    const ViewAngles back = angles_from_rotation(rotation_from_angles(angles));
    EXPECT_NEAR(back.yaw_rad, angles.yaw_rad, 1e-9);
    EXPECT_NEAR(back.pitch_rad, angles.pitch_rad, 1e-9);
    EXPECT_NEAR(back.roll_rad, angles.roll_rad, 1e-6);
  }
}

TEST(Motion, StraightUpAndDownTheYawLeavesNoRoll) {
  for (const double pitch : {kPi / 2, -kPi / 2}) {
    const ViewAngles back = angles_from_rotation(rotation_from_angles({0.7, pitch, 0}));
    EXPECT_NEAR(back.yaw_rad, 0.7, 1e-9);
    EXPECT_NEAR(back.pitch_rad, pitch, 1e-7);
    EXPECT_NEAR(back.roll_rad, 0, 1e-9);
  }
}

TEST(Motion, YawTurnsLeftAndPitchLooksUp) {
  const glm::dvec3 left = rotation_from_angles({kPi / 2, 0, 0}) * glm::dvec3(0, 0, -1);
  EXPECT_LT(glm::distance(left, glm::dvec3(-1, 0, 0)), 1e-12);
  const glm::dvec3 up = rotation_from_angles({0, kPi / 2, 0}) * glm::dvec3(0, 0, -1);
  EXPECT_LT(glm::distance(up, glm::dvec3(0, 1, 0)), 1e-12);
}

// Turns up to both poles and half turns, with irregular steps. The rotation between two poses, measured on the
// quaternions, stays within the limits, and the camera neither rolls nor passes a pole.
TEST(Motion, TurningObeysTheLimitsAndStopsAtThePoles) {
  CounterRandom random(44, 0, RandomPurpose::kTest);
  const CameraLimits limits{.max_angular_speed_radps = 2, .max_angular_acceleration_radps2 = 9};
  TurnState state;
  ViewAngles aim;
  for (int step = 0; step < 20000; ++step) {
    if (random.next_below(40) == 0) {
      const double pitch = random.next_in(-3, 3);  // beyond straight up and down half of the time
      aim = {random.next_in(-kPi, kPi), std::clamp(pitch, -kMaxPitchRad, kMaxPitchRad), 0};
    }
    const double dt = random.next_in(0.001, 0.04);
    const TurnState next = turn_towards(state, aim, limits, random.next_in(0, 0.5), dt);
    const double turned = angle_between(rotation_from_angles(state.angles), rotation_from_angles(next.angles));
    EXPECT_LE(turned, 2 * dt * (1 + 1e-6) + 1e-9);
    const glm::dvec2 change(next.yaw_rate_radps - state.yaw_rate_radps, next.pitch_rate_radps - state.pitch_rate_radps);
    EXPECT_LE(glm::length(change), 9 * dt * (1 + 1e-9));
    EXPECT_EQ(next.angles.roll_rad, 0.0);
    EXPECT_LE(std::abs(next.angles.pitch_rad), kMaxPitchRad + 1e-12);
    state = next;
  }
}

// Limits that are lowered during a turn can leave too little acceleration to brake for the pole. The camera stops at
// the pole even then.
TEST(Motion, LoweredLimitsNeverTurnTheCameraPastAPole) {
  CounterRandom random(45, 0, RandomPurpose::kTest);
  TurnState state;
  for (int step = 0; step < 20000; ++step) {
    CameraLimits limits;
    limits.max_angular_speed_radps = random.next_in(0.1, 20);
    limits.max_angular_acceleration_radps2 = random.next_below(3) == 0 ? random.next_in(50, 200) : 0.5;
    const ViewAngles aim{random.next_in(-kPi, kPi), random.next_below(2) == 0 ? kMaxPitchRad : -kMaxPitchRad, 0};
    state = turn_towards(state, aim, limits, 0, random.next_in(0.001, 0.25));
    ASSERT_LE(std::abs(state.angles.pitch_rad), kMaxPitchRad + 1e-12) << step;
  }
}

TEST(Motion, AHalfTurnTakesTheShortWayAndSettles) {
  TurnState state;
  state.angles.yaw_rad = 3.0;
  const ViewAngles aim{-3.0, 0, 0};  // 0.283 rad further on across the seam
  double travelled = 0;
  for (int i = 0; i < 300; ++i) {
    const TurnState next = turn_towards(state, aim, {}, 0.2, 1.0 / 60);
    travelled += std::abs(std::remainder(next.angles.yaw_rad - state.angles.yaw_rad, 2 * kPi));
    state = next;
  }
  EXPECT_NEAR(std::remainder(state.angles.yaw_rad - aim.yaw_rad, 2 * kPi), 0, 1e-4);
  EXPECT_LT(travelled, 0.3);
}

TEST(Motion, RollGivenAtTheStartIsLetGoWithinTheLimits) {
  TurnState state;
  state.angles.roll_rad = 0.5;
  const TurnState next = turn_towards(state, {}, {}, 0.2, 0.1);
  EXPECT_NEAR(next.roll_rate_radps, -12 * 0.1, 1e-9) << "the acceleration";
  EXPECT_NEAR(next.angles.roll_rad, 0.5 - 12 * 0.1 * 0.1, 1e-9);
}

TEST(Motion, ARollIsReachedGentlyWithoutGoingBeyond) {
  for (const double aim_rad : {0.6, -0.3}) {
    TurnState state;
    for (int i = 0; i < 240; ++i) {
      const TurnState next = turn_towards(state, {0, 0, aim_rad}, {}, 0.4, 1.0 / 60);
      EXPECT_LE(std::abs(next.roll_rate_radps - state.roll_rate_radps),
                CameraLimits{}.max_angular_acceleration_radps2 / 60 * (1 + 1e-9));
      EXPECT_LE(std::abs(next.angles.roll_rad), std::abs(aim_rad) + 0.01);
      state = next;
    }
    EXPECT_EQ(state.angles.roll_rad, aim_rad);
  }
}

TEST(Motion, ARolledCameraTurnsAndLevelsWithinTheSpeedLimit) {
  TurnState state;
  state.angles.roll_rad = 2.5;
  for (int i = 0; i < 300; ++i) {
    const TurnState next = turn_towards(state, {2.0, 1.0, 0}, {}, 0.2, 1.0 / 60);
    EXPECT_LE(angle_between(rotation_from_angles(state.angles), rotation_from_angles(next.angles)),
              CameraLimits{}.max_angular_speed_radps / 60 * (1 + 1e-6));
    state = next;
  }
  EXPECT_EQ(state.angles.roll_rad, 0.0);
}

TEST(Motion, LimitsOutOfRangeAreNamed) {
  const auto field = [](const CameraLimits& limits) { return validate(limits, Lens{}).error().field; };
  EXPECT_EQ(field({.max_speed_mps = 0}), "max_speed_mps");
  EXPECT_EQ(field({.max_acceleration_mps2 = -1}), "max_acceleration_mps2");
  EXPECT_EQ(field({.max_angular_speed_radps = std::nan("")}), "max_angular_speed_radps");
  EXPECT_EQ(field({.max_angular_acceleration_radps2 = 1e9}), "max_angular_acceleration_radps2");
  EXPECT_EQ(field({.body_radius_m = 0.05}), "body_radius_m") << "smaller than the near plane's corners";
  EXPECT_TRUE(validate(CameraLimits{}, Lens{}));
}

}  // namespace
}  // namespace sightline
