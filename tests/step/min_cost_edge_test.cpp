// The default preset at the ends of its input ranges: bodies, speeds, volumes, counts, positions.
#include <gtest/gtest.h>

#include "tests/support/filming.h"

namespace sightline::test {
namespace {

constexpr double kTick = 1.0 / 60;

// The occluder does not collide, so only the least distance keeps the lost camera away from the target.
TEST(MinCostEdge, ALostCameraKeepsItsDistance) {
  OneFilmed world;
  ASSERT_TRUE(
      world.mirror.apply({.base_revision = {}, .remove = {}, .add = {}, .change = {{1, {.collides = false}}}}, {}));
  world.add_box(10, {0, 1, 0}, {0.7, 1.2, 0.7}, {.collides = false});
  world.settings.move.min_distance_m = 2;
  world.settings.bound.max_horizon_s = world.settings.bound
                                           .horizon_s;  // so that no reachable position is inside the box
  Watch watch(world);
  StepResult r;
  for (int i = 0; i < 300; ++i) {
    world.step_in(watch, r);
    ASSERT_GE(world.distance_m(), 1.9) << "step " << i;
  }
}

// At 29 m/s the camera needs 42 m to stop. The target is never seen, and the wall stands across its way.
TEST(MinCostEdge, AFastCameraThatIsLostStopsBeforeTheWall) {
  OneFilmed world({0, 1.6, 70});
  world.limits.max_speed_mps = 30;
  world.settings.bound.target_reach_m = 100;
  world.settings.move.max_distance_m = 3;
  world.add_box(10, {0, 1, 0}, {0.7, 1.2, 0.7}, {.collides = false});
  world.add_box(11, {0, 1, 12}, {25, 300, 0.5});
  world.stepper.place_camera(world.camera().pose, {0, 0, -29});
  Watch watch(world);
  StepResult r;
  double fastest = 0;
  for (int i = 0; i < 600; ++i) {
    world.step_in(watch, r);
    fastest = std::max(fastest, glm::length(r.camera.velocity_mps));
    if (HasFailure()) return;
  }
  EXPECT_GT(fastest, 15);
}

TEST(MinCostEdge, AWideBodyFindsItsWayToo) {
  OneFilmed world({0, 1.4, 6});
  world.limits.body_radius_m = 1.0;
  world.settings.bound.target_reach_m = 0;
  world.settings.bound.horizon_s = world.settings.bound.max_horizon_s = 0.45;
  world.add_box(10, {0, 1.5, 3.6}, {0.3, 6, 0.1});
  Watch watch(world);
  StepResult r;
  for (int i = 0; i < 300; ++i) world.step_in(watch, r);
  EXPECT_EQ(r.targets[0].visible_share, 1.0);
}

class MinCostEdgeTargets : public testing::TestWithParam<int> {};
TEST_P(MinCostEdgeTargets, AnyNumberIsFilmedFarFromTheOrigin) {
  Filming world;
  const int n = GetParam();
  const glm::dvec3 far(10'000, 5, -10'000);
  for (int i = 0; i < n; ++i)
    world.add_target(static_cast<uint64_t>(i) + 1, far + glm::dvec3(1.5 * (i % 4) - 2.25, 0, -1.5 * (i / 4)),
                     i % 5 != 4, i > 0 && i % 3 == 2 ? 0.0 : 1.0);
  world.add_box(1000, far + glm::dvec3(0, 0, 5), {0.5, 3, 0.1});
  world.settings.move.viewpoint_search.resolution = 2, world.settings.sample.resolution = 2;
  world.place(far + glm::dvec3(0, 3, 12), far);
  Watch watch(world);
  StepResult r;
  for (int i = 0; i < 150; ++i) world.step_in(watch, r);
  EXPECT_EQ(r.targets.size(), static_cast<size_t>(n));
  EXPECT_GT(r.targets[0].visible_share, 0.0);
}
INSTANTIATE_TEST_SUITE_P(Counts, MinCostEdgeTargets, testing::Values(1, 2, 16, 32));

TEST(MinCostEdge, WithoutTargetsOrWeightsItComesToRest) {
  OneFilmed world;
  Watch watch(world);
  StepResult r;
  for (int i = 0; i < 60; ++i) {
    world.move(1, {0.1 * i, 1, 0}, {6, 0, 0});
    world.step_in(watch, r);
  }
  world.targets[0].weight = 0;
  for (int i = 0; i < 30; ++i) world.step_in(watch, r);
  EXPECT_EQ(r.reason, MoveReason::kNoTargets);
  world.targets.clear();
  for (int i = 0; i < 120; ++i) world.step_in(watch, r);
  EXPECT_EQ(r.reason, MoveReason::kNoTargets);
  EXPECT_LT(glm::length(r.camera.velocity_mps), 1e-3);
}

// The camera is placed exactly at the point that it looks at: there is no direction and no distance.
TEST(MinCostEdge, ACameraInsideItsTargetLeavesIt) {
  OneFilmed world;
  world.place({0, 1, 0}, {1, 1, 0});
  ASSERT_TRUE(
      world.mirror.apply({.base_revision = {}, .remove = {}, .add = {}, .change = {{1, {.collides = false}}}}, {}));
  Watch watch(world);
  for (int i = 0; i < 300; ++i) watch.step(i % 7 == 3 ? 0.0 : kTick);
  EXPECT_GE(world.distance_m(), 0.9 * world.settings.move.min_distance_m);
}

}  // namespace
}  // namespace sightline::test
