// The reported share of a target that is visible in the picture.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/support/world.h"

namespace sightline::test {
namespace {

constexpr double kTick = 1.0 / 60;

// One person in front of a camera that cannot move or turn; eight points a step. Boards hide the person or are moved
// past.
struct Still : World {
  explicit Still(const glm::dvec3& target = {0, 1, 0}) {
    add_target(1, target);
    place({0, 1, 6}, {0, 1, 0});
    settings.sample.points = 8;
    limits.max_acceleration_mps2 = limits.max_angular_acceleration_radps2 = 1e-6;
  }
  void add_board(double left, double right, double z, uint64_t id = 10) {
    const glm::vec3 half((right - left) / 2, 3.0, 0.001);
    add_box(id, {(left + right) / 2, 1, z}, half, {.collides = false});
  }
  void remove(uint64_t id) { mirror.apply({.base_revision = {}, .remove = {id}, .add = {}, .change = {}}, {}); }
  TargetSight look(double dt_s = kTick) { return step(dt_s).targets[0]; }
};

// A board's edge on the person's middle line hides one half of it.
TEST(Share, EstimatesTheVisiblePixelsWithLessNoiseThanAStep) {
  Still world;
  world.add_board(-3, 0, 3);
  for (int i = 0; i < 10; ++i) world.look();
  double sum = 0, error = 0, step_error = 0;
  constexpr int kSteps = 64;
  for (int i = 0; i < kSteps; ++i) {
    const TargetSight sight = world.look();
    sum += sight.filtered_share;
    error += std::abs(sight.filtered_share - 0.5), step_error += std::abs(sight.visible_share - 0.5);
  }
  EXPECT_NEAR(sum / kSteps, 0.5, 0.07) << "one view of the table alone says 0.39";
  EXPECT_LT(error / kSteps, 0.07);
  EXPECT_LT(error, 0.7 * step_error);
}

TEST(Share, DoesNotDependOnTheFilterOfTheCandidates) {
  const auto shares = [](FilterMode mode) {
    Still world;
    world.settings.aggregate.filter.mode = mode;
    world.add_board(-3, 0.1, 3);
    std::vector<double> out;
    for (int i = 0; i < 20; ++i) out.push_back(world.look().filtered_share);
    return out;
  };
  EXPECT_EQ(shares(FilterMode::kNone), shares(FilterMode::kJoint));
  EXPECT_EQ(shares(FilterMode::kNone), shares(FilterMode::kPerTarget));
}

// The person stands across the picture's right edge, at 6 tan(half the horizontal angle of view).
TEST(Share, CountsOnlyWhatThePictureHolds) {
  const double edge = 6 * std::tan(Lens{}.vertical_fov_rad / 2) * Lens{}.aspect;
  Still outside_hidden({edge, 1, 0}), inside_hidden({edge, 1, 0});
  outside_hidden.add_board(edge / 2 + 0.001, edge, 3);
  inside_hidden.add_board(0, edge / 2 + 0.001, 3);
  double share_of_all = 0;
  for (int i = 0; i < 32; ++i) {
    const TargetSight shown = outside_hidden.look(), hidden = inside_hidden.look();
    EXPECT_EQ(shown.filtered_share, 1.0);
    EXPECT_EQ(hidden.filtered_share, 0.0);
    share_of_all += shown.visible_share / 32;
  }
  EXPECT_NEAR(share_of_all, 0.5, 0.1);
}

TEST(Share, OutsideThePictureItIsOfTheWholeTarget) {
  Still world({20, 1, 0});
  EXPECT_EQ(world.look().filtered_share, 1.0);
  world.add_board(9, 11, 3);
  for (int i = 0; i < 20; ++i) world.look();
  const TargetSight sight = world.look();
  EXPECT_FALSE(sight.in_picture);
  EXPECT_EQ(sight.filtered_share, 0.0);
}

// Surfaces nearer than the near plane are not drawn.
TEST(Share, WhatIsTooNearTheLensHidesNothing) {
  Still near, far;
  near.add_board(-1, 1, 6 - 0.9 * Lens{}.near_m);
  far.add_board(-1, 1, 6 - 1.1 * Lens{}.near_m);
  for (int i = 0; i < 16; ++i) {
    EXPECT_EQ(near.look().filtered_share, 1.0);
    EXPECT_EQ(far.look().filtered_share, 0.0);
  }
}

TEST(Share, ForgetsWhatWasSeenBeforeACutOrALongStep) {
  for (const char* how : {"cut", "long step", "neither"}) {
    Still world;
    for (int i = 0; i < 20; ++i) world.look();
    world.add_board(-1, 1, 3);
    if (how == std::string("cut")) world.place({0, 1, 6}, {0, 1, 0});
    const TargetSight sight = world.look(how == std::string("long step") ? 1.0 : kTick);
    EXPECT_EQ(sight.visible_share, 0.0) << how;
    if (how == std::string("neither"))
      EXPECT_GT(sight.filtered_share, 0.4);
    else
      EXPECT_EQ(sight.filtered_share, 0.0) << how;
  }
}

// Sights look at the camera, maps look at the bound far ahead of a fast camera. Each starts from the points that the
// target shows in that direction.
TEST(Share, SightsAreOfThePointsThatTheTargetShowsTheCamera) {
  World world;
  world.add_target(1, {0, 1, 0});
  world.settings.sample.points = 8;
  world.stepper.place_camera({{0, 1, 6}, {1, 0, 0, 0}}, {9, 0, 0});
  const glm::dvec3 on_course = world.camera().pose.position_m + world.camera().velocity_mps * kTick;
  world.step(kTick);
  const auto table = ExtentTable::build(*world.mirror.find(1)->geometry);
  const auto are_shown_to = [&](const std::vector<glm::dvec3>& points_m, const glm::dvec3& place_m) {
    const glm::dvec3 at(0, 1, 0);  // where the target stands, upright
    const auto shown = table->points(place_m - at);
    return std::all_of(points_m.begin(), points_m.end(), [&](const glm::dvec3& p) {
      return std::any_of(shown.begin(), shown.end(),
                         [&](const glm::vec3& q) { return glm::distance(glm::dvec3(q) + at, p) < 1e-6; });
    });
  };
  const Sampled& now = world.stepper.dump().plan.now;
  ASSERT_EQ(now.sights_m.size(), 8u);
  ASSERT_EQ(now.points_m.size(), 8u);
  EXPECT_TRUE(are_shown_to(now.sights_m, on_course));
  EXPECT_TRUE(are_shown_to(now.points_m, world.stepper.dump().bound.center_m));
  EXPECT_FALSE(are_shown_to(now.sights_m, world.stepper.dump().bound.center_m));
}

}  // namespace
}  // namespace sightline::test
