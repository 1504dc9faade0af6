// Shots lined up with targets far apart, against a plain search over the angles of the camera.
#include "server/move/line_up.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "server/base/random.h"
#include "server/move/choose.h"
#include "server/move/motion.h"

namespace sightline {
namespace {

constexpr double kRoom = 0.7;  // that the targets of a shot may fill when it is not turned
constexpr double kDegree = 0.017453292519943295;

TrackedTarget at(double x, double y, double z) {
  TrackedTarget target;
  target.aim_m = {x, y, z};
  return target;
}

// Turns a camera all round in small steps: does one of the pictures hold all targets?
bool fits_plainly(const glm::dvec3& eye_m, const std::vector<TrackedTarget>& targets, const Lens& lens, double room) {
  const double half_x = half_horizontal_fov_rad(lens) * room, half_y = lens.vertical_fov_rad / 2 * room;
  for (double yaw = -180; yaw < 180; yaw += 1)
    for (double pitch = -60; pitch <= 60; pitch += 1) {
      const glm::dquat camera_from_world = glm::conjugate(rotation_from_angles({yaw * kDegree, pitch * kDegree, 0}));
      if (std::ranges::all_of(targets, [&](const TrackedTarget& t) {
            const glm::dvec3 p = camera_from_world * (t.aim_m - eye_m);
            return std::abs(std::atan2(p.x, -p.z)) <= half_x && std::abs(std::atan2(p.y, -p.z)) <= half_y;
          }))
        return true;
    }
  return false;
}

struct Shot {
  explicit Shot(const std::vector<TrackedTarget>& seen) : targets(seen) {}
  std::vector<TrackedTarget> targets;
  glm::dvec3 offset_m{0, 1, 5}, camera_m{0, 1, 5};
  Lens lens;
  MoveSettings settings;
  glm::dvec3 former_end_m{0.0};
  SeenFrom is_seen_from = [](const glm::dvec3&) { return true; };

  FarShot far() const { return {targets, offset_m, camera_m, lens, settings, former_end_m}; }
  std::optional<glm::dvec3> lined_up_m() const {
    const std::optional<LinedUp> lined_up = line_up(far(), is_seen_from);
    return lined_up ? std::optional(lined_up->offset_m) : std::nullopt;
  }
  glm::dvec3 place_m(const glm::dvec3& towards) const { return farthest_place_m(targets, towards, settings); }
};

double azimuth_rad(const glm::dvec3& towards) {
  return std::atan2(towards.z, towards.x);
}

TEST(LineUp, AShotThatShowsItsTargetsIsKept) {
  for (const double half_m : {0.0, 1.0, 5.0, 9.0}) {
    const Shot shot({at(-half_m, 0, 0), at(half_m, 0, 0)});
    EXPECT_FALSE(shot.lined_up_m()) << half_m;
    EXPECT_TRUE(fits_from_side(shot.far(), kRoom));
  }
}

// From its place the targets fit, and the room that is to be left is left. It is not left by a shot that is turned 5
// degrees less.
TEST(LineUp, AShotIsTurnedUntilItsTargetsFitAndNoFarther) {
  CounterRandom random(7, 0, RandomPurpose::kTest);
  int turned = 0;
  for (int trial = 0; trial < 25; ++trial) {
    Shot shot({at(random.next_in(-20, -14), random.next_in(0, 1), random.next_in(-3, 3)),
               at(random.next_in(14, 20), random.next_in(0, 1), random.next_in(-3, 3))});
    shot.offset_m = shot.camera_m = {random.next_in(-1, 1), random.next_in(0.3, 1.5), random.next_in(4, 8)};
    if (fits_from_side(shot.far(), kRoom)) continue;
    ASSERT_TRUE(shot.lined_up_m());
    const glm::dvec3 offset_m = *shot.lined_up_m();
    ASSERT_NEAR(glm::length(offset_m), glm::length(shot.offset_m), 1e-9);
    ASSERT_TRUE(fits_plainly(shot.place_m(offset_m), shot.targets, shot.lens, kRoom + 0.05)) << trial;
    const double turn_rad = std::remainder(azimuth_rad(offset_m) - azimuth_rad(shot.offset_m), 360 * kDegree);
    if (std::abs(turn_rad) < 6 * kDegree) continue;
    ++turned;
    const double less_rad = azimuth_rad(offset_m) - std::copysign(5 * kDegree, turn_rad),
                 flat_m = std::hypot(offset_m.x, offset_m.z);
    const glm::dvec3 less_m(std::cos(less_rad) * flat_m, offset_m.y, std::sin(less_rad) * flat_m);
    EXPECT_FALSE(fits_plainly(shot.place_m(less_m), shot.targets, shot.lens, kRoom - 0.02)) << trial;
  }
  EXPECT_GT(turned, 15);
}

TEST(LineUp, TheCameraGoesToTheEndOfTheRequiredThenTheHeavierThenToTheNearerOne) {
  for (const double side : {-1.0, 1.0}) {
    Shot shot({at(-20, 0, 0), at(20, 0, 0)});
    const auto end = [&] { return side * shot.lined_up_m()->x; };
    shot.camera_m = {side, 1, 5};
    EXPECT_GT(end(), 0);
    shot.camera_m = {-5 * side, 1, 5};
    shot.targets[side < 0 ? 0 : 1].weight = 1.2;
    EXPECT_GT(end(), 0) << "the heavier one";
    shot.targets[side < 0 ? 0 : 1].required = false;
    EXPECT_LT(end(), 0) << "the required one";
    shot.former_end_m = glm::dvec3(30 * side, 1, 0);
    EXPECT_GT(end(), 0) << "the end that was chosen before";
    shot.is_seen_from = [&](const glm::dvec3& offset_m) { return side * offset_m.x < 0; };
    EXPECT_LT(end(), 0) << "the only end that sees them";
    shot.is_seen_from = [](const glm::dvec3&) { return false; };
    EXPECT_FALSE(shot.lined_up_m());
  }
}

// The shot leans to the side of the optional target. The camera turns to the other end, and goes on to do so.
TEST(LineUp, AShotThatLeansToTheOtherEndKeepsToItsEnd) {
  Shot shot({at(-20, 0, 0), at(20, 0, 0)});
  shot.targets[1].required = false;
  shot.offset_m = shot.camera_m = {1.5, 1, 5};
  for (int k = 0; k < 3; ++k) {
    const auto lined_up = line_up(shot.far(), shot.is_seen_from);
    ASSERT_TRUE(lined_up);
    EXPECT_LT(lined_up->end_m.x, 0) << k;
    shot.former_end_m = lined_up->end_m;
  }
}

// The ends are 30 m from the centre. Their targets are seen from there, not from the place where the shot is turned to.
TEST(LineUp, WhetherTheTargetsAreSeenIsAskedAboutTheEnds) {
  Shot shot({at(-18, 0, 0), at(18, 0, 0)});
  int asked = 0;
  shot.is_seen_from = [&](const glm::dvec3& offset_m) {
    ++asked;
    EXPECT_NEAR(std::abs(offset_m.x), 30 * std::cos(0.05), 1e-9);
    return true;
  };
  ASSERT_TRUE(shot.lined_up_m());
  EXPECT_GT(shot.lined_up_m()->z, 1);
  EXPECT_GT(asked, 0);
}

// One end is nearer to the light target, and both ends hold all three. A target that sways about the centre does not
// change the end.
TEST(LineUp, ATargetThatSwaysInTheMiddleDoesNotChangeTheEnd) {
  Shot shot({at(-17, 0, 0), at(0.5, 0, 0), at(17, 0, 0)});
  for (int k = 0; k < 10; ++k) {
    shot.targets[1].aim_m.x = k % 2 == 0 ? 0.5 : -0.5;
    const auto lined_up = line_up(shot.far(), shot.is_seen_from);
    ASSERT_TRUE(lined_up);
    if (k > 0) {
      EXPECT_GT(glm::dot(lined_up->end_m, shot.former_end_m), 0) << k;
    }
    shot.former_end_m = lined_up->end_m;
  }
}

// The centre is nearer to the heavy one, and so is the camera's place at 30 m. At the other end the light target would
// be too near.
TEST(LineUp, TheCameraGoesToTheOnlyEndThatHoldsBoth) {
  Shot shot({at(-11.8, 0, 0), at(29.5, 0, 0)});
  shot.targets[0].weight = 2.5, shot.targets[0].required = false;
  shot.camera_m = {3, 1, 5};
  ASSERT_NEAR(weighted_center_m(shot.targets).x, 0, 1e-9);
  ASSERT_TRUE(shot.lined_up_m());
  EXPECT_LT(shot.lined_up_m()->x, 0);
  EXPECT_TRUE(fits_plainly(shot.place_m(*shot.lined_up_m()), shot.targets, shot.lens, 1.0));
  shot.targets[0].aim_m.x = -12.2, shot.targets[1].aim_m.x = 30.5;
  EXPECT_FALSE(shot.lined_up_m()) << "the far one would be 60.5 m away, which is more than twice the greatest distance";
}

TEST(LineUp, TargetsTooFarApartForEveryPlaceLeaveTheShotAsItIs) {
  for (const double half_m : {29.5, 32.0, 80.0}) {
    const Shot shot({at(-half_m, 0, 0), at(half_m, 0, 0)});
    EXPECT_FALSE(shot.lined_up_m()) << half_m;
    EXPECT_FALSE(fits_in_line(shot.far(), 1.0)) << half_m;
  }
}

TEST(LineUp, ThePlaceKeepsItsDistanceAndTheLimitsOfElevation) {
  Shot shot({at(-25, 0, 0), at(25, 0, 0)});
  EXPECT_TRUE(fits_in_line(shot.far(), 1.0));
  EXPECT_NEAR(std::asin(shot.lined_up_m()->y / glm::length(shot.offset_m)), 0.05, 0.02);
  shot.settings.min_distance_m = 6;
  EXPECT_FALSE(fits_in_line(shot.far(), 1.0)) << "it is 5 m behind the near one";
  shot.settings.min_distance_m = 5.15;
  EXPECT_TRUE(fits_in_line(shot.far(), 1.0));
  EXPECT_FALSE(fits_in_line(shot.far(), 0.9)) << "room to return is room behind the near one, too";
  shot.settings.min_distance_m = 1, shot.settings.min_elevation_rad = 0.5;
  EXPECT_FALSE(fits_in_line(shot.far(), 1.0)) << "the near one is too far below";
}

// A camera that is as low as its targets rises, or the near one would hide the far one.
TEST(LineUp, ALowShotRises) {
  Shot shot({at(-25, 0, 0), at(25, 0, 0)});
  shot.offset_m = shot.camera_m = {0, -0.5, 5};
  ASSERT_TRUE(shot.lined_up_m());
  EXPECT_GT(shot.lined_up_m()->y, 0.1);
}

TEST(LineUp, TargetsWithoutAWeightDoNotCount) {
  Shot shot({at(-3, 0, 0), at(3, 0, 0), at(200, 0, 0)});
  shot.targets[2].weight = 0;
  EXPECT_FALSE(shot.lined_up_m());
}

TEST(LineUp, TargetsAboveEachOtherHaveNoLineOnTheGround) {
  const Shot shot({at(0, 0, 0), at(0, 30, 0)});
  EXPECT_FALSE(fits_from_side(shot.far(), kRoom));
  EXPECT_FALSE(shot.lined_up_m());
}

}  // namespace
}  // namespace sightline
