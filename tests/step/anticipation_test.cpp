// The camera moves before a target is hidden, because its flight plan knows from where the target will be seen.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/support/filming.h"

namespace sightline::test {
namespace {

// A target that walks round the end of a high wall, seen from above:
//
//   camera   target ->        |
//                             | then it goes back behind the wall
//   ===========================
//
struct RoundACorner : OneFilmed {
  RoundACorner() : OneFilmed({0, 1.8, 5}) {
    add_box(9, {0, -0.5, 0}, {60, 0.5, 60});
    add_box(10, {0, 15, -1.5}, {8.0, 15, 0.2});
    settings.move.max_elevation_rad = 0.6;  // it cannot look over the wall
    settings.move.search_viewpoints = false;
  }
  // 3 m/s along the wall, round its end, and back on its other side.
  glm::dvec3 target_m(double time_s) const {
    const double way_m = 3.0 * time_s;
    if (way_m < 9.2) return {way_m, 1, 0};
    if (way_m < 12.2) return {9.2, 1, 9.2 - way_m};
    return {std::max(9.2 - (way_m - 12.2), 4.0), 1, -3.0};
  }
  int hidden_steps() {
    int hidden = 0;
    Watch watch(*this);
    StepResult r;
    for (int i = 0; i < 420; ++i) {
      const double time_s = i / 60.0;
      move(1, target_m(time_s), (target_m(time_s) - target_m(time_s - 1.0 / 60)) * 60.0);
      step_in(watch, r);
      hidden += r.targets[0].visible_share < 0.5;
    }
    return hidden;
  }
};

TEST(Anticipation, TheTargetIsSeenRoundACorner) {
  EXPECT_EQ(RoundACorner().hidden_steps(), 0);
}

TEST(Anticipation, IsWorthMoreThanAnswering) {
  RoundACorner answers;
  answers.settings.move.prediction_s = 0;
  EXPECT_GT(answers.hidden_steps(), RoundACorner().hidden_steps() + 6) << "without a prediction it comes too late";
}

// The extremes of the points from which a plan's maps are taken, relative to the target's middle.
struct PointsOfPlan {
  double aside_m = 0, above_m = 0, below_m = 0;
};
// The targets' middle is at (0, 1, 0).
PointsOfPlan points_of_plan(World& world) {
  world.settings = Filming().settings;
  world.place({0, 3, 9}, {0, 1, 0});
  PointsOfPlan extremes;
  for (int i = 0; i < 200; ++i) {
    world.step(1.0 / 60);
    for (const SampledSlice& slice : world.dump().plan.slices)
      for (const glm::dvec3& point : slice.sampled.points_m) {
        extremes.aside_m = std::max(extremes.aside_m, std::hypot(point.x, point.z));
        extremes.above_m = std::max(extremes.above_m, point.y - 1);
        extremes.below_m = std::max(extremes.below_m, 1 - point.y);
      }
  }
  return extremes;
}

// Capsules of 0.3 m by 0.9 m, standing.
PointsOfPlan points_of_walkers(size_t targets) {
  World world;
  for (size_t i = 0; i < targets; ++i) world.add_target(1 + i, {0, 1, 0});
  return points_of_plan(world);
}

TEST(Anticipation, PlansForTargetsThatAreWiderAndTaller) {
  const PointsOfPlan two = points_of_walkers(2);
  EXPECT_NEAR(two.aside_m, 2 * 0.3, 0.02);
  EXPECT_NEAR(two.above_m, 1.5 * 0.9, 0.05);
  EXPECT_LE(two.below_m, 0.9 + 1e-6) << "the ground is there";
}

TEST(Anticipation, ManyTargetsHaveASmallerMargin) {
  const PointsOfPlan four = points_of_walkers(4), eight = points_of_walkers(8);
  EXPECT_NEAR(four.aside_m, 1.5 * 0.3, 0.02);
  EXPECT_NEAR(four.above_m, 1.25 * 0.9, 0.05);
  EXPECT_NEAR(eight.aside_m, 4.0 / 3 * 0.3, 0.02);
  EXPECT_NEAR(eight.above_m, 7.0 / 6 * 0.9, 0.05);
}

TEST(Anticipation, LargeTargetsHaveAMarginInMetres) {
  World world;
  world.add_box(1, {0, 1, 0}, {2, 1.5, 2});
  world.targets.resize(1);
  world.targets[0].instance_id = 1;
  const PointsOfPlan lorry = points_of_plan(world);
  EXPECT_NEAR(lorry.aside_m, std::hypot(2, 2) + 0.35, 0.15);
  EXPECT_NEAR(lorry.above_m, 1.5 + 0.45, 0.1);
}

}  // namespace
}  // namespace sightline::test
