// On an open plane, a target is faster than the camera may be. The camera uses all of its allowed speed, and keeps the
// limits of acceleration and jerk. Behind a car that it can follow, its goal does not jump.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/filming.h"

namespace sightline::test {
namespace {

struct Limits {
  double speed_mps, acceleration_mps2;
};

// The acceleration and the jerk are taken from the returned positions, by finite differences.
class Chase : public testing::TestWithParam<Limits> {
 protected:
  static constexpr double kTickS = 1.0 / 60;
};

TEST_P(Chase, TheCameraIsAsFastAsItMayBehindAFasterTarget) {
  OneFilmed world;
  world.limits.max_speed_mps = GetParam().speed_mps;
  world.limits.max_acceleration_mps2 = GetParam().acceleration_mps2;
  world.settings.move.max_distance_m = 1e4;  // the target outruns the camera
  Watch watch(world);
  StepResult r;
  glm::dvec3 at_m = world.camera().pose.position_m, velocity_mps(0.0), acceleration_mps2(0.0);
  double x_m = 0, speed_mps = 0, fastest_mps = 0;
  for (int i = 0; i < 900; ++i) {
    speed_mps = std::min(1.2 * GetParam().speed_mps, speed_mps + GetParam().acceleration_mps2 * kTickS);
    world.move(1, {x_m += speed_mps * kTickS, 1, 0}, {speed_mps, 0, 0});
    world.step_in(watch, r);
    const glm::dvec3 now_m = world.camera().pose.position_m, now_mps = (now_m - at_m) / kTickS;
    const glm::dvec3 now_mps2 = (now_mps - velocity_mps) / kTickS;
    EXPECT_LE(glm::distance(now_mps2, acceleration_mps2) / kTickS, world.limits.max_jerk_mps3 * (1 + 1e-4))
        << "step " << i;
    at_m = now_m, velocity_mps = now_mps, acceleration_mps2 = now_mps2;
    fastest_mps = std::max(fastest_mps, glm::length(velocity_mps));
  }
  EXPECT_GE(fastest_mps, 0.98 * GetParam().speed_mps);
  EXPECT_GE(glm::length(velocity_mps), 0.98 * GetParam().speed_mps) << "and keeps that speed";
}

INSTANTIATE_TEST_SUITE_P(Limits, Chase, testing::Values(Limits{12, 4}, Limits{10, 10}, Limits{40, 20}, Limits{3, 30}));

// The target is suddenly 8 m farther off and stays there. A camera that has not seen it hurries after it.
double fastest_mps(bool hidden) {
  OneFilmed world;
  const auto place_target = [&](const glm::dvec3& at_m) {
    world.move(1, at_m);
    if (hidden) world.move(2, at_m);
  };
  if (hidden) world.add_box(2, {0, 1, 0}, {1, 1, 1});
  for (int i = 0; i < 60; ++i) place_target({0, 1, 0}), world.step(1.0 / 60);
  double fastest_mps = 0;
  for (int i = 0; i < 240; ++i) {
    place_target({0, 1, -8}), world.step(1.0 / 60);
    fastest_mps = std::max(fastest_mps, glm::length(world.camera().velocity_mps));
  }
  return fastest_mps;
}

TEST(Chase, ACameraThatSeesItsTargetIsInLessOfAHurryThanOneThatDoesNot) {
  const double seen_mps = fastest_mps(false), unseen_mps = fastest_mps(true);
  EXPECT_GT(seen_mps, 1);
  EXPECT_GT(unseen_mps, 1.3 * seen_mps);
}

// Counts the steps at which the goal moves by more than half a metre beside a car. `drive` moves target 1 for one step
// and returns where it is. The camera keeps up with the car.
template <typename Drive>
int jumps_behind_car(OneFilmed& world, int steps, Drive drive) {
  world.limits.max_speed_mps = 40;
  world.limits.max_acceleration_mps2 = 20;
  std::optional<glm::dvec3> former_m;
  int jumps = 0;
  for (int i = 0; i < steps; ++i) {
    const glm::dvec3 car_m = drive();
    world.step(1.0 / 60);
    const std::optional<glm::dvec3> goal_m = world.dump().decision.goal_m;
    EXPECT_TRUE(goal_m) << "step " << i;
    if (!goal_m) return steps;
    if (former_m) jumps += glm::distance(*goal_m - car_m, *former_m) > 0.5;
    former_m = *goal_m - car_m;
    EXPECT_LT(glm::distance(world.camera().pose.position_m, car_m), 15) << "step " << i;
  }
  return jumps;
}

// The limits allow 10 m/s, reached within 10 m and lost within 10 m.
TEST(Chase, AFarTargetIsReachedNearlyAsSoonAsTheLimitsAllow) {
  OneFilmed world({0, 1.8, 6});
  world.settings.move.max_distance_m = 1000;
  Watch watch(world);
  for (int i = 0; i < 60; ++i) watch.step();
  world.move(1, {0, 1, -100});
  int ticks = 0;
  while (glm::distance(world.camera().pose.position_m, glm::dvec3(0, 1.8, -94)) > 0.5 && ticks < 3000)
    watch.step(), ++ticks;
  EXPECT_LT(ticks / 60.0, 1.2 * (80.0 / 10 + 2 * 20.0 / 10));
}

// Where the camera will be in a second, behind the car, is too near to where the car is now.
TEST(Chase, TheGoalBehindACarThatSpeedsUpDoesNotJump) {
  OneFilmed world({-6, 3, 0});
  double x_m = 0, speed_mps = 0;
  const auto drive = [&] {
    speed_mps = std::min(30.0, speed_mps + 10.0 / 60);
    world.move(1, {x_m += speed_mps / 60, 1, 0}, {speed_mps, 0, 0});
    return glm::dvec3(x_m, 1, 0);
  };
  EXPECT_EQ(jumps_behind_car(world, 300, drive), 0);
}

// The house hides the car of the next second from the edge of the bound. But the camera will be farther then.
TEST(Chase, TheGoalBehindACarThatDrivesRoundAHouseDoesNotJump) {
  constexpr double kRadiusM = 16, kSpeedMps = 15;
  OneFilmed world({kRadiusM, 3, -6});
  world.add_box(2, {0, 5, 0}, {6, 5, 6});
  double angle_rad = 0;
  const auto drive = [&] {
    angle_rad += kSpeedMps / kRadiusM / 60;
    const glm::dvec3 at_m(kRadiusM * std::cos(angle_rad), 1, kRadiusM * std::sin(angle_rad));
    world.move(1, at_m, glm::dvec3(-std::sin(angle_rad), 0, std::cos(angle_rad)) * kSpeedMps);
    return at_m;
  };
  EXPECT_EQ(jumps_behind_car(world, 600, drive), 0);
}

}  // namespace
}  // namespace sightline::test
