#include "server/move/framing.h"

#include <gtest/gtest.h>

#include <cmath>

#include "server/base/random.h"

namespace sightline {
namespace {

TrackedTarget target_at(const glm::dvec3& aim, double radius = 0.5, double weight = 1.0, bool required = true) {
  TrackedTarget view;
  view.aim_m = aim;
  view.radius_m = radius;
  view.weight = weight;
  view.required = required;
  return view;
}

FramingSettings no_dead_zone() {
  FramingSettings settings;
  settings.dead_zone = 0;
  return settings;
}

Pose pose_of(const glm::dvec3& eye, const Aim& aim) {
  return {eye, rotation_from_angles(aim.angles)};
}

TEST(Framing, OneTargetStandsInTheMiddle) {
  CounterRandom random(51, 0, RandomPurpose::kTest);
  for (int trial = 0; trial < 500; ++trial) {
    const glm::dvec3 eye(random.next_in(-5, 5), random.next_in(-5, 5), random.next_in(-5, 5));
    const glm::dvec3 aim(random.next_in(-9, 9), random.next_in(-2, 2), random.next_in(-9, 9));
    if (glm::distance(eye, aim) < 3) continue;
    const std::vector<TrackedTarget> targets = {target_at(aim)};
    const Pose pose = pose_of(eye, aim_at(eye, targets, {}, {}, {.framing = no_dead_zone()}));
    const glm::dvec3 p = inverse_transform_point(pose, aim);
    EXPECT_NEAR(p.x / -p.z, 0, 1e-3);
    EXPECT_NEAR(p.y / -p.z, 0, 1e-3);
  }
}

// Points of the required targets' spheres, projected plainly, are all inside the picture whenever the aim says that
// they fit.
TEST(Framing, RequiredTargetsAreInThePictureWholeWhenTheyFit) {
  CounterRandom random(52, 0, RandomPurpose::kTest);
  int fitted = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    std::vector<TrackedTarget> targets;
    const int n = 1 + random.next_below(5);
    for (int i = 0; i < n; ++i)
      targets.push_back(target_at({random.next_in(-4, 4), random.next_in(-1, 1), random.next_in(-3, 3)},
                                  random.next_in(0.1, 0.9), random.next_in(0.1, 3),
                                  i == 0 || random.next_below(3) > 0));
    const glm::dvec3 eye(random.next_in(-3, 3), random.next_in(-1, 5), random.next_in(7, 20));
    const Aim aim = aim_at(eye, targets, {}, {}, {.framing = no_dead_zone()});
    if (!aim.fits) continue;
    ++fitted;
    const Pose pose = pose_of(eye, aim);
    for (const TrackedTarget& t : targets) {
      if (!t.required) continue;
      for (int i = 0; i < 20; ++i) {
        const glm::dvec3 d(random.next_in(-1, 1), random.next_in(-1, 1), random.next_in(-1, 1));
        ASSERT_TRUE(in_picture(pose, {}, t.aim_m + glm::normalize(d) * t.radius_m * 0.98));
      }
    }
  }
  EXPECT_GT(fitted, 500);
}

// Points of the bodies' cylinders, projected plainly.
TEST(Framing, BodiesAreInThePictureWholeWhenTheyFit) {
  CounterRandom random(53, 0, RandomPurpose::kTest);
  int fitted = 0, sphere_did_not = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    std::vector<TrackedTarget> targets;
    for (int i = 0; i < 1 + trial % 4; ++i) {
      targets.push_back(target_at({random.next_in(-2, 2), random.next_in(-0.5, 0.5), random.next_in(-2, 2)}, 0.95));
      targets.back().low_m = random.next_in(0.3, 0.9), targets.back().high_m = random.next_in(0.3, 0.9),
      targets.back().aside_m = 0.3;
    }
    const glm::dvec3 eye(random.next_in(-3, 3), random.next_in(-1, 7), random.next_in(3, 12));
    const Aim aim = aim_at(eye, targets, {}, {}, {.framing = no_dead_zone()});
    if (!aim.fits) continue;
    ++fitted;
    const Pose pose = pose_of(eye, aim);
    for (const TrackedTarget& t : targets)
      for (int i = 0; i < 20; ++i) {
        const double turn = random.next_in(0, 7);
        const glm::dvec3 out(0.97 * t.aside_m * std::cos(turn), (i % 2 == 0 ? -t.low_m : t.high_m) * 0.98,
                             0.97 * t.aside_m * std::sin(turn));
        ASSERT_TRUE(in_picture(pose, {}, t.aim_m + out)) << trial;
      }
    for (TrackedTarget& t : targets) t.low_m = t.high_m = t.aside_m = 0;
    sphere_did_not += !aim_at(eye, targets, {}, {}, {.framing = no_dead_zone()}).fits;
  }
  EXPECT_GT(fitted, 300);
  EXPECT_GT(sphere_did_not, 30) << "the spheres are wider";
}

TEST(Framing, HeavierTargetsStandNearerTheMiddle) {
  const std::vector<TrackedTarget> targets = {target_at({-2, 0, -10}, 0.3, 5.0), target_at({2, 0, -10}, 0.3, 1.0)};
  const Pose pose = pose_of({0, 0, 0}, aim_at({0, 0, 0}, targets, {}, {}, {.framing = no_dead_zone()}));
  const double left = inverse_transform_point(pose, targets[0].aim_m).x,
               right = inverse_transform_point(pose, targets[1].aim_m).x;
  EXPECT_LT(std::abs(left), std::abs(right));
}

TEST(Framing, OptionalTargetsGiveWayToRequiredOnes) {
  const std::vector<TrackedTarget> targets = {target_at({0, 0, -6}), target_at({30, 0, -6}, 0.5, 1.0, false)};
  const Pose pose = pose_of({0, 0, 0}, aim_at({0, 0, 0}, targets, {}, {}, {.framing = no_dead_zone()}));
  EXPECT_TRUE(in_picture(pose, {}, targets[0].aim_m));
  EXPECT_FALSE(in_picture(pose, {}, targets[1].aim_m));
}

TEST(Framing, InsideTheDeadZoneTheViewDoesNotTurn) {
  const std::vector<TrackedTarget> targets = {target_at({0.4, 0.3, -10})};
  const ViewAngles present{0.01, -0.01, 0};
  const Aim centred = aim_at({0, 0, 0}, targets, present, {}, {.framing = no_dead_zone()});
  ASSERT_GT(std::abs(centred.angles.yaw_rad - present.yaw_rad), 0.03) << "without a dead zone it turns";
  ASSERT_GT(std::abs(centred.angles.pitch_rad - present.pitch_rad), 0.03);
  FramingSettings settings;
  settings.dead_zone = 0.2;
  const Aim aim = aim_at({0, 0, 0}, targets, present, {}, {.framing = settings});
  EXPECT_EQ(aim.angles.yaw_rad, present.yaw_rad);
  EXPECT_EQ(aim.angles.pitch_rad, present.pitch_rad);
}

// One target straight ahead of an angle. The picture is wider than high, so each axis has a dead zone of its own.
TEST(Framing, BeyondTheDeadZoneTheViewTurnsToItsEdge) {
  const Lens lens;
  const double half_y = lens.vertical_fov_rad / 2, half_x = std::atan(std::tan(half_y) * lens.aspect);
  ASSERT_GT(half_x, 1.3 * half_y);
  FramingSettings settings;
  settings.dead_zone = 0.4;
  for (const double share : {0.35, 0.6, -0.35, -0.6}) {
    const double beyond = std::max(std::abs(share) - 0.4, 0.0) * (share < 0 ? -1 : 1);
    const double yaw = share * half_x, pitch = share * half_y;
    const glm::dvec3 aside(-10 * std::sin(yaw), 0, -10 * std::cos(yaw)),
        above(0, 10 * std::sin(pitch), -10 * std::cos(pitch));
    const Aim turned = aim_at({0, 0, 0}, std::vector{target_at(aside)}, {}, lens, {.framing = settings});
    EXPECT_NEAR(turned.angles.yaw_rad, beyond * half_x, 1e-6) << share;
    EXPECT_NEAR(turned.angles.pitch_rad, 0.0, 1e-9);
    const Aim raised = aim_at({0, 0, 0}, std::vector{target_at(above)}, {}, lens, {.framing = settings});
    EXPECT_NEAR(raised.angles.pitch_rad, beyond * half_y, 1e-6) << share;
    EXPECT_NEAR(raised.angles.yaw_rad, 0.0, 1e-9);
  }
}

TEST(Framing, StraightUpAndDownAreDefined) {
  for (const double y : {-10.0, 10.0}) {
    const std::vector<TrackedTarget> targets = {target_at({0, y, 0})};
    const Aim aim = aim_at({0, 0, 0}, targets, {1.2, 0, 0}, {}, {.framing = no_dead_zone()});
    EXPECT_NEAR(aim.angles.yaw_rad, 1.2, 1e-9) << "the yaw stays";
    EXPECT_NEAR(aim.angles.pitch_rad, std::copysign(std::acos(-1.0) / 2, y), 2e-3);
  }
}

TEST(Framing, CameraOnTheTargetIsDefined) {
  const std::vector<TrackedTarget> targets = {target_at({1, 2, 3})};
  const Aim aim = aim_at({1, 2, 3}, targets, {0.4, 0.1, 0}, {}, {.framing = no_dead_zone()});
  EXPECT_TRUE(std::isfinite(aim.angles.yaw_rad) && std::isfinite(aim.angles.pitch_rad));
}

TEST(Framing, ZoomShowsTheGroupWithItsMarginInsideTheRange) {
  FramingSettings settings = no_dead_zone();
  settings.min_vertical_fov_rad = 0.06;
  settings.max_vertical_fov_rad = 1.5;
  const std::vector<TrackedTarget> targets = {target_at({-1, 0, -10}), target_at({1, 0, -10})};
  const Aim near = aim_at({0, 0, 0}, targets, {}, {}, {.framing = settings});
  const Aim far = aim_at({0, 0, 40}, targets, {}, {}, {.framing = settings});
  EXPECT_GT(near.vertical_fov_rad, far.vertical_fov_rad);
  EXPECT_EQ(far.vertical_fov_rad, 0.06);
  Lens lens;
  lens.vertical_fov_rad = near.vertical_fov_rad;
  EXPECT_TRUE(in_picture(pose_of({0, 0, 0}, near), lens, {-1.5, 0, -10}));
}

}  // namespace
}  // namespace sightline
