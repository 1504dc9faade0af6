// How the picture of an asked shot is composed: roll, lead room, dead and soft zones, and the lens range.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "server/move/framing.h"
#include "tests/support/filming.h"

namespace sightline::test {
namespace {

constexpr double kPi = std::numbers::pi, kTick = 1.0 / 60;

struct Shown : ShotFilmed {
  using ShotFilmed::ShotFilmed;

  glm::dvec2 in_picture_of(const glm::dvec3& point_m, const StepResult& result) const {
    return in_halves(point_m, result.vertical_fov_rad);
  }
  StepResult film(Watch& watch, int ticks) {
    StepResult result;
    for (int i = 0; i < ticks; ++i) step_in(watch, result);
    return result;
  }
};

// How far the horizon rises to the right in the picture: the slope of what is level in the world, seen straight ahead.
double horizon_rad(const Pose& camera) {
  const glm::dvec3 forward = camera.rotation * glm::dvec3(0, 0, -1);
  const glm::dvec3 level = glm::normalize(glm::cross(forward, glm::dvec3(0, 1, 0)));  // to the right
  const glm::dvec3 in_picture = glm::conjugate(camera.rotation) * level;
  return std::atan2(in_picture.y, in_picture.x);
}

TEST(PictureRules, ARollLeansThePictureGentlyAndTheBodiesStayInIt) {
  Shown world({0, 1.6, 6});
  world.add_target(2, {1.5, 1, 0});
  Watch watch(world);
  watch.may_lean = true;
  world.film(watch, 30);
  AskedShot leaning;
  leaning.roll_rad = -0.35;
  world.ask(leaning);
  StepResult result;
  double former_rad = horizon_rad(world.camera().pose), former_rate = 0, fastest = 0, hardest = 0;
  for (int i = 0; i < 240; ++i) {
    world.step_in(watch, result);
    const double rate = (horizon_rad(world.camera().pose) - former_rad) / kTick;
    fastest = std::max(fastest, std::abs(rate)), hardest = std::max(hardest, std::abs(rate - former_rate) / kTick);
    former_rad += rate * kTick, former_rate = rate;
  }
  EXPECT_NEAR(former_rad, 0.35, 0.005) << "the horizon rises to the right";
  EXPECT_LE(fastest, world.limits.max_angular_speed_radps);
  EXPECT_LE(hardest, 1.1 * world.limits.max_angular_acceleration_radps2);
  ASSERT_TRUE(result.shot);
  EXPECT_NEAR(result.shot->asked_roll_rad, -0.35, 1e-12);
  EXPECT_NEAR(result.shot->roll_rad, -0.35, 0.005);
  EXPECT_LT(result.shot->roll_deviation, 0.01);
  for (const double x_m : {0.0, 1.5})
    for (const double y_m : {0.1, 1.9}) {
      const glm::dvec2 at = glm::abs(world.in_picture_of({x_m, y_m, 0}, result));
      EXPECT_LT(std::max(at.x, at.y), 1.0) << x_m << " " << y_m;
    }
  for (const TargetSight& target : result.targets) EXPECT_GT(target.picture_share, 0.99);
  world.ask(AskedShot{});
  world.film(watch, 240);
  EXPECT_NEAR(horizon_rad(world.camera().pose), 0.0, 0.005);
}

// Runs to and fro across the picture at 3 m/s, and stands in the end. Returns the mean place in the picture while
// running to the right, to the left, and standing.
std::array<double, 3> places_of_a_runner(const AskedShot& shot) {
  Shown world({0, 1.8, 9});
  world.ask(shot);
  Watch watch(world);
  StepResult result;
  std::array<double, 3> sum{};
  std::array<int, 3> count{};
  double x_m = 0;
  for (int i = 0; i < 900; ++i) {
    const double time_s = i * kTick;
    const size_t phase = time_s < 5 ? 0 : time_s < 10 ? 1 : 2;
    const double speed_mps = phase == 0 ? 3.0 : phase == 1 ? -3.0 : 0.0;
    x_m += speed_mps * kTick;
    world.move(1, {x_m, 1, 0}, {speed_mps, 0, 0});
    world.step_in(watch, result);
    if (std::fmod(time_s, 5.0) < 3.5) continue;
    sum[phase] += world.in_picture_of({x_m, 1, 0}, result).x, ++count[phase];
  }
  for (size_t phase = 0; phase < 3; ++phase) sum[phase] /= count[phase];
  return sum;
}

TEST(PictureRules, LeadRoomLeavesRoomWhereARunnerGoes) {
  AskedShot plain, leading;
  leading.lead_room = 0.4;
  const auto without = places_of_a_runner(plain), with = places_of_a_runner(leading);
  EXPECT_NEAR(with[0] - without[0], -0.4, 0.1) << "to the right: it is left of the middle";
  EXPECT_NEAR(with[1] - without[1], 0.4, 0.1);
  EXPECT_NEAR(with[2], without[2], 2 * 0.05 + 0.01) << "who stands is in the middle, but for the dead zone";
}

TEST(PictureRules, LeadRoomByHeadingLeavesRoomWhereAPersonLooks) {
  for (const double side : {1.0, -1.0}) {
    Shown world({0, 1.8, 6});
    TransformUpdate update;
    update.ids = {1}, update.poses = {Pose{{0, 1, 0}, glm::angleAxis(side * kPi / 2, glm::dvec3(0, 1, 0))}};
    ASSERT_TRUE(world.mirror.apply({}, update));
    AskedShot talking;
    talking.lead_room = 0.3, talking.lead_by_heading = true;
    world.ask(talking);
    Watch watch(world);
    const StepResult result = world.film(watch, 300);
    EXPECT_NEAR(world.in_picture_of({0, 1, 0}, result).x, -side * 0.3, 0.08)
        << "faces " << (side > 0 ? "right" : "left");
  }
}

TEST(PictureRules, FromBehindNoRoomIsLeft) {
  Shown world({0, 1.8, 6});
  AskedShot chase;
  chase.lead_room = 0.5;
  world.ask(chase);
  Watch watch(world);
  double z_m = 0;
  StepResult result;
  for (int i = 0; i < 300; ++i) {
    z_m -= 2 * kTick;
    world.move(1, {0, 1, z_m}, {0, 0, -2});
    world.step_in(watch, result);
  }
  EXPECT_NEAR(world.in_picture_of({0, 1, z_m}, result).x, 0, 0.06);
}

// Steps to and fro by 0.8 m every 2 s, before a camera that stays where it is. Returns how far the camera turns in all,
// in halves of the picture.
double turns_before_a_nervous_person(const std::optional<glm::dvec2>& dead_zone) {
  Shown world({0, 1.8, 7});
  world.limits.max_speed_mps = 1e-6;
  AskedShot shot;
  shot.dead_zone = dead_zone;
  world.ask(shot);
  Watch watch(world);
  world.film(watch, 60);
  double turned = 0, former = yaw_and_pitch(world.camera().pose.rotation).x;
  for (int i = 0; i < 480; ++i) {
    world.move(1, {0.4 * std::sin(i * kTick * kPi), 1, 0}, {0.4 * kPi * std::cos(i * kTick * kPi), 0, 0});
    watch.step();
    const double now = yaw_and_pitch(world.camera().pose.rotation).x;
    turned += std::abs(now - former), former = now;
  }
  return turned / half_horizontal_fov_rad(world.lens);
}

TEST(PictureRules, InsideTheDeadZoneTheCameraDoesNotTurn) {
  EXPECT_GT(turns_before_a_nervous_person({}), 0.5);
  EXPECT_LT(turns_before_a_nervous_person(glm::dvec2(0.3, 0.3)), 0.02);
  EXPECT_GT(turns_before_a_nervous_person(glm::dvec2(0.02, 0.9)), 0.5) << "the zone upwards does not count sideways";
}

TEST(PictureRules, ADeadZoneCutsNobodyOff) {
  Shown world({0, 1.8, 4.5});
  world.limits.max_speed_mps = 1e-6;
  AskedShot shot;
  shot.dead_zone = glm::dvec2(0.9, 0.9);
  world.ask(shot);
  Watch watch(world);
  for (int i = 0; i < 600; ++i) {
    world.move(1, {3.0 * std::sin(i * kTick), 1, 0}, {3.0 * std::cos(i * kTick), 0, 0});
    StepResult result = watch.step();
    if (i > 60) {
      ASSERT_GT(result.targets[0].picture_share, 0.85) << i;
    }
  }
}

// A runner who starts at 6 m/s across the picture before a camera that stays where it is. Returns the greatest distance
// from the middle, in halves of the picture.
double farthest_off(double soft_zone) {
  Shown world({0, 1.8, 12});
  world.limits.max_speed_mps = 1e-6;
  AskedShot shot;
  shot.soft_zone = glm::dvec2(soft_zone);
  world.ask(shot);
  world.settings.framing.aim_response_s = 5.0;
  Watch watch(world);
  world.film(watch, 60);
  double most = 0;
  for (int i = 0; i < 120; ++i) {
    const double x_m = 6 * i * kTick;
    world.move(1, {x_m, 1, 0}, {6, 0, 0});
    const StepResult result = watch.step();
    most = std::max(most, std::abs(world.in_picture_of({x_m, 1, 0}, result).x));
  }
  return most;
}

TEST(PictureRules, OutsideTheSoftZoneTheCameraHurries) {
  EXPECT_GT(farthest_off(0.0), 0.45);
  EXPECT_LT(farthest_off(0.3), 0.36);
}

TEST(PictureRules, WithALensRangeTheLensKeepsTheSizeWhereAWallKeepsTheCameraAway) {
  const auto height_share = [](const Shown& world, const StepResult& result) {
    return (world.in_picture_of({0, 1.9, 0}, result).y - world.in_picture_of({0, 0.1, 0}, result).y) / 2;
  };
  double with_lens = 0, without = 0;
  for (const bool zooms : {false, true}) {
    Shown world({0, 1.4, 3});
    // A room in which the camera can be at most 5 m away.
    for (const double side : {-1.0, 1.0}) {
      world.add_box(side > 0 ? 50 : 51, {side * 4.2, 2, 0}, {0.2, 2.4, 4.4});
      world.add_box(side > 0 ? 52 : 53, {0, 2, side * 4.2}, {4.4, 2.4, 0.2});
    }
    world.add_box(54, {0, 4.2, 0}, {4.4, 0.2, 4.4});
    AskedShot asked;
    asked.size = 0.3, asked.side_rad = 0, asked.height_rad = 0.05;
    if (zooms) asked.min_vertical_fov_rad = 0.3, asked.max_vertical_fov_rad = 1.5;
    world.ask(asked);
    world.settings.move.keep_shot = 10;
    world.limits.body_radius_m = 0.5;
    Watch watch(world);
    const StepResult result = world.film(watch, 420);
    (zooms ? with_lens : without) = height_share(world, result);
    EXPECT_TRUE(zooms || result.vertical_fov_rad == world.lens.vertical_fov_rad);
    EXPECT_TRUE(!zooms || (result.vertical_fov_rad >= 0.3 && result.vertical_fov_rad <= 1.5));
  }
  EXPECT_NEAR(with_lens, 0.3, 0.05);
  EXPECT_GT(std::abs(without - 0.3), 0.1) << "the wall is in the way";
}

}  // namespace
}  // namespace sightline::test
