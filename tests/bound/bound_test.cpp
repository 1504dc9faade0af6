#include "server/bound/bound.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "server/base/random.h"
#include "server/move/motion.h"

namespace sightline {
namespace {

CameraState camera_moving(const glm::dvec3& velocity) {
  CameraState camera;
  camera.pose.position_m = {1, 2, 3};
  camera.velocity_mps = velocity;
  return camera;
}

TEST(Bound, HorizonRadiusIsWhatTheAccelerationReaches) {
  const Bound bound = bound_camera(camera_moving({0, 0, 0}), {}, {}, 0.5, 1.0 / 60);
  EXPECT_DOUBLE_EQ(bound.radius_m, 0.5 * 10 * 0.25);
  EXPECT_EQ(bound.center_m, glm::dvec3(1, 2, 3));
}

TEST(Bound, SpeedLimitCapsTheRadius) {
  CameraLimits limits;
  limits.max_speed_mps = 1.0;
  EXPECT_DOUBLE_EQ(bound_camera(camera_moving({0, 0, 0}), limits, {}, 0.5, 0.01).radius_m, 0.5);
}

TEST(Bound, PaperModeIsTheSphereAsPrinted) {
  BoundSettings settings;
  settings.mode = BoundMode::kPaper;
  settings.paper_n = 300;
  const double dt = 1.0 / 60;
  const Bound bound = bound_camera(camera_moving({0, 0, 2}), {}, settings, settings.horizon_s, dt);
  EXPECT_NEAR(bound.radius_m, 300 * dt * dt * 10, 1e-12);
  EXPECT_NEAR(glm::distance(bound.center_m, glm::dvec3(1, 2, 3 + 2 * dt)), 0, 1e-12);
  EXPECT_NEAR(bound.paper_n, 300, 1e-9);
}

// A camera that escapes looks farther ahead: with a horizon three times as long, the sphere is three times as wide, and
// its factor n too.
TEST(Bound, ALongerHorizonWidensTheSphereOfThePaper) {
  BoundSettings settings;
  settings.mode = BoundMode::kPaper;
  settings.paper_n = 300;
  const double dt = 1.0 / 60;
  const Bound bound = bound_camera(camera_moving({0, 0, 2}), {}, settings, 3 * settings.horizon_s, dt);
  EXPECT_NEAR(bound.radius_m, 3 * 300 * dt * dt * 10, 1e-12);
  EXPECT_NEAR(bound.paper_n, 900, 1e-9);
  EXPECT_DOUBLE_EQ(bound.horizon_s, dt);
}

TEST(Bound, DerivedFactorReproducesTheRadius) {
  const double dt = 1.0 / 60;
  const Bound bound = bound_camera(camera_moving({0, 0, 0}), {}, {}, 0.5, dt);
  EXPECT_NEAR(bound.paper_n * dt * dt * 10, bound.radius_m, 1e-12);
}

// By random accelerations: every position that the limits let the camera reach from rest within the horizon lies in the
// ball.
TEST(Bound, HoldsEveryPlaceThatIsReachedFromRest) {
  CounterRandom random(3, 0, RandomPurpose::kTest);
  const CameraLimits limits;
  for (int trial = 0; trial < 300; ++trial) {
    CameraState camera = camera_moving({0, 0, 0});
    const Bound bound = bound_camera(camera, limits, {}, 0.5, 0.01);
    // A step moves by the new velocity, so n steps cover n (n + 1) / 2 dt^2 a. One step less stays within a T^2 / 2.
    for (int step = 0; step < 49; ++step) {
      const glm::dvec3 push(random.next_in(-1, 1), random.next_in(-1, 1), random.next_in(-1, 1));
      camera.velocity_mps = clamp_velocity(camera.velocity_mps, camera.velocity_mps + push * 100.0, limits, 0.01);
      camera.pose.position_m += camera.velocity_mps * 0.01;
      ASSERT_TRUE(bound.contains(camera.pose.position_m));
    }
  }
}

TEST(Bound, AlwaysHoldsTheCameraItself) {
  for (const double speed : {0.0, 1.0, 5.0, 10.0}) {
    const CameraState camera = camera_moving({speed, 0, 0});
    for (const double horizon : {0.05, 0.5, 2.0})
      EXPECT_TRUE(bound_camera(camera, {}, {}, horizon, 0.01).contains(camera.pose.position_m));
  }
}

// Random balls and points, some inside the ball or at its centre. Each promise of the header is checked by itself.
TEST(ExtendTowards, ReachesTheGivenDistanceAndKeepsAway) {
  CounterRandom random(4, 0, RandomPurpose::kTest);
  const auto vec = [&](double size) {
    return glm::dvec3(random.next_in(-size, size), random.next_in(-size, size), random.next_in(-size, size));
  };
  int extended = 0, kept_off = 0, left = 0;
  for (int trial = 0; trial < 3000; ++trial) {
    Bound bound;
    bound.center_m = vec(trial % 2 ? 5 : 10'000), bound.radius_m = random.next_in(0.05, 4);
    bound.horizon_s = 0.5, bound.paper_n = trial % 3 * 100.0;
    const glm::dvec3 point = trial % 10 == 0 ? bound.center_m : bound.center_m + vec(8);
    const double towards = trial % 7 == 0 ? 0.0 : random.next_in(0, 10),
                 nearest = trial % 5 == 0 ? 0.0 : random.next_in(0, 3);
    const double before = glm::distance(point, bound.center_m) - bound.radius_m;
    const Bound out = extend_towards(bound, point, towards, nearest);
    const double after = glm::distance(point, out.center_m) - out.radius_m;
    ASSERT_TRUE(std::isfinite(out.radius_m) && std::isfinite(out.center_m.x + out.center_m.y + out.center_m.z));
    EXPECT_LE(glm::distance(out.center_m, bound.center_m) + bound.radius_m, out.radius_m + 1e-9)
        << "contains the old ball";
    EXPECT_EQ(out.horizon_s, bound.horizon_s);
    EXPECT_NEAR(out.paper_n / out.radius_m, bound.paper_n / bound.radius_m, 1e-6) << "the factor is of the radius";
    const double wanted = std::max(nearest, before - towards);
    if (wanted >= before) {
      EXPECT_EQ(out.center_m, bound.center_m);
      EXPECT_EQ(out.radius_m, bound.radius_m);
      ++left;
      continue;
    }
    EXPECT_NEAR(after, wanted, 1e-8);
    EXPECT_NEAR(2 * out.radius_m, 2 * bound.radius_m + before - wanted, 1e-8) << "the least such ball";
    ++(wanted == nearest ? kept_off : extended);
  }
  EXPECT_GT(extended, 300);
  EXPECT_GT(kept_off, 300);
  EXPECT_GT(left, 300);
}

}  // namespace
}  // namespace sightline
