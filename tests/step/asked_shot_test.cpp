// Shots that the client asks for: frames that turn, size, places in the picture, cuts, blends, and what the report
// says.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>

#include "server/move/framing.h"
#include "tests/support/filming.h"

namespace sightline::test {
namespace {

constexpr double kPi = std::numbers::pi, kTick = 1.0 / 60;

double degrees(double rad) {
  return rad * 180 / kPi;
}

// Facing along `direction` with the front axis +Z.
glm::dquat facing(const glm::dvec3& direction) {
  return glm::angleAxis(std::atan2(direction.x, direction.z), glm::dvec3(0, 1, 0));
}

struct Shown : ShotFilmed {
  using ShotFilmed::ShotFilmed;

  void turn_to(uint64_t id, const glm::dvec3& at_m, const glm::dvec3& velocity_mps, const glm::dvec3& direction) {
    TransformUpdate update;
    update.ids = {id}, update.poses = {Pose{at_m, facing(direction)}}, update.velocities_mps = {velocity_mps};
    ASSERT_TRUE(mirror.apply({}, update));
  }
};

// A runner goes round a circle of 6 m at 3 m/s. `follow`: the frame. Returns the share of the ticks after the first 3 s
// in which the camera is within 45 degrees of being behind.
double share_behind(ShotFrame frame) {
  Shown world({0, 1.8, 5});
  AskedShot chase;
  chase.frame = frame, chase.side_rad = kPi, chase.height_rad = 0.2, chase.distance_m = 5;
  world.ask(chase);
  Watch watch(world);
  int behind = 0, ticks = 0;
  for (int i = 0; i < 1500; ++i) {
    const double angle = 3.0 / 6.0 * i * kTick;
    const glm::dvec3 at_m(6 * std::sin(angle), 1, 6 * (1 - std::cos(angle))),
        along(std::cos(angle), 0, std::sin(angle));
    // A client without rotations keeps the first one.
    world.turn_to(1, at_m, 3.0 * along, frame == ShotFrame::kTravel ? glm::dvec3(0, 0, 1) : along);
    StepResult result;
    world.step_in(watch, result);
    if (i < 180) continue;
    const glm::dvec3 back_m = world.camera().pose.position_m - at_m;
    behind += glm::dot(glm::normalize(glm::dvec3(back_m.x, 0, back_m.z)), -along) > std::cos(kPi / 4), ++ticks;
  }
  return static_cast<double>(behind) / ticks;
}

TEST(AskedShot, AChaseCameraKeepsBehindARunnerWhoTurns) {
  EXPECT_GT(share_behind(ShotFrame::kHeading), 0.95);
  EXPECT_GT(share_behind(ShotFrame::kTravel), 0.95);
  EXPECT_LT(share_behind(ShotFrame::kWorld), 0.6) << "the frame makes the difference";
}

TEST(AskedShot, ARunnerWhoStopsIsStillShownFromBehind) {
  Shown world({-5, 1.8, 0});
  AskedShot chase;
  chase.frame = ShotFrame::kTravel, chase.side_rad = kPi, chase.height_rad = 0.15, chase.distance_m = 5;
  world.ask(chase);
  Watch watch(world);
  double x_m = 0;
  for (int i = 0; i < 600; ++i) {
    const double speed_mps = i < 240 ? 2.0 : 0.0;
    x_m += speed_mps * kTick;
    world.move(1, {x_m, 1, 0}, {speed_mps, 0, 0});
    watch.step();
  }
  EXPECT_LT(glm::distance(world.camera().pose.position_m,
                          glm::dvec3(x_m, 1, 0) + offset_in_frame({kPi, 0.15, 5}, *yaw_of({1, 0, 0}))),
            0.5);
}

TEST(AskedShot, ThePictureFromRightAboveDoesNotTurn) {
  Shown world({0, 9, 0.5});
  world.settings.move.max_elevation_rad = kPi / 2;
  AskedShot above;
  above.side_rad = kPi, above.height_rad = kPi / 2, above.distance_m = 8;
  world.ask(above);
  Watch watch(world);
  double least = 1e9, greatest = -1e9, farthest_off = 0;
  for (int i = 0; i < 900; ++i) {
    const double angle = 1.4 / 2.0 * i * kTick;
    const glm::dvec3 at_m(2 * std::sin(angle), 1, 2 * (1 - std::cos(angle)));
    world.move(1, at_m, 1.4 * glm::dvec3(std::cos(angle), 0, std::sin(angle)));
    watch.step();
    if (i < 240) continue;
    const double yaw = yaw_and_pitch(world.camera().pose.rotation).x;
    least = std::min(least, yaw), greatest = std::max(greatest, yaw);
    const glm::dvec2 off = glm::abs(world.in_halves(at_m));
    farthest_off = std::max({farthest_off, off.x, off.y});
  }
  EXPECT_LT(degrees(greatest - least), 0.5);
  EXPECT_LT(farthest_off, 0.6) << "the walker is in the picture";
}

TEST(AskedShot, OverTheShoulderShowsTheShoulderAndAllOfTheOther) {
  Shown world({0, 1.8, -3});
  world.add(2, CapsuleShape{0.3f, 0.6f}, {0, 1, 3.5});
  world.targets[0].instance_id = 2;  // the face; person 1 has the shoulder
  for (const double right : {1.0, -1.0}) {
    AskedShot over;
    over.subject_ids = {1}, over.frame = ShotFrame::kLine, over.frame_id = 1, over.line_to_id = 2;
    over.side_rad = right * 2.6, over.height_rad = 0.35, over.distance_m = 1.5, over.tolerance = 0.3,
    over.places = {{2, {right * 0.3, 0.1}}};
    world.ask(over);
    Watch watch(world);
    StepResult result;
    for (int i = 0; i < 300; ++i) world.step_in(watch, result);
    const glm::dvec3 eye_m = world.camera().pose.position_m;
    EXPECT_LT(glm::distance(eye_m, glm::dvec3(0, 1, 0)), 1.8) << "it is not pushed away";
    EXPECT_GT(result.targets[0].visible_share, 0.95);
    EXPECT_GT(result.targets[0].picture_share, 0.95);
    EXPECT_NEAR(world.in_halves({0, 1, 3.5}).x, right * 0.3, 0.1);
    // The shoulder is at the end of the capsule's cylinder, 0.6 m above the middle, on the side of the camera.
    const glm::dvec2 shoulder = world.in_halves({-right * 0.3, 1.6, 0});
    EXPECT_LT(std::abs(shoulder.x), 1) << right;
    EXPECT_LT(std::abs(shoulder.y), 1) << right;
    ASSERT_TRUE(result.shot);
    EXPECT_GT(result.shot->worth, 0.9);
  }
}

TEST(AskedShot, ASizeIsThatOfTheBodyInThePictureAndOfAGroupThatSpreads) {
  Shown world({0, 1.6, 6});
  AskedShot medium;
  medium.size = 0.5;
  world.ask(medium);
  Watch watch(world);
  for (int i = 0; i < 240; ++i) watch.step();
  const double high = world.in_halves({0, 1.9, 0}).y, low = world.in_halves({0, 0.1, 0}).y;
  EXPECT_NEAR((high - low) / 2, 0.5, 0.06);
  world.add_target(2, {1, 1, 0});
  double last_m = 0;
  for (const double x_m : {2.0, 4.0, 6.0}) {
    world.move(2, {x_m, 1, 0});
    for (int i = 0; i < 240; ++i) watch.step();
    const double width = (world.in_halves({x_m + 0.3, 1, 0}).x - world.in_halves({-0.3, 1, 0}).x) / 2;
    EXPECT_NEAR(std::max(width, (world.in_halves({0, 1.9, 0}).y - world.in_halves({0, 0.1, 0}).y) / 2), 0.5, 0.08)
        << x_m;
    const double distance_m = glm::distance(world.camera().pose.position_m, glm::dvec3(x_m / 2, 1, 0));
    EXPECT_GT(distance_m, last_m - 0.3);
    last_m = distance_m;
  }
  EXPECT_GT(last_m, 8);
}

TEST(AskedShot, AnOrbitGoesRoundAtItsSpeed) {
  Shown world({0, 2.5, 5});
  AskedShot orbit;
  orbit.orbit_radps = 0.4;
  world.ask(orbit);
  Watch watch(world);
  double round_rad = 0, last_rad = 0;
  for (int i = 0; i < 1200; ++i) {
    watch.step();
    const glm::dvec3 from_m = world.camera().pose.position_m - glm::dvec3(0, 1, 0);
    const double now_rad = std::atan2(from_m.x, from_m.z);
    if (i > 0) round_rad += std::remainder(now_rad - last_rad, 2 * kPi);
    last_rad = now_rad;
    EXPECT_NEAR(glm::length(from_m), std::hypot(1.5, 5), 1.0);
  }
  // To the right of somebody who faces the first camera is towards -X.
  EXPECT_NEAR(round_rad, -0.4 * 20, 0.5);
}

TEST(AskedShot, TheFirstPicturesPlaceIsKept) {
  Shown world;
  const glm::dvec3 aside(1.0, 0, 0);
  world.place({0, 1.6, 6}, glm::dvec3(0, 1, 0) + aside);
  const glm::dvec2 asked = world.in_halves({0, 1, 0});
  ASSERT_LT(asked.x, -0.2);
  Watch watch(world);
  for (int i = 0; i < 600; ++i) {
    const double x_m = 1.4 * i * kTick;
    world.move(1, {x_m, 1, 0}, {1.4, 0, 0});
    watch.step();
    if (i <= 120) continue;
    EXPECT_NEAR(world.in_halves({x_m, 1, 0}).x, asked.x, 0.12) << i;
  }
}

TEST(AskedShot, ACutIsAtTheShotAtOnceAndFlagged) {
  Shown world;
  world.step(kTick);
  AskedShot there;
  there.side_rad = kPi, there.height_rad = 0.3, there.distance_m = 7, there.cut = true;
  world.ask(there);
  const StepResult result = world.step(kTick);
  EXPECT_TRUE(result.cut);
  EXPECT_EQ(result.reason, MoveReason::kCut);
  EXPECT_LT(glm::distance(result.camera.pose.position_m,
                          glm::dvec3(0, 1, 0) + offset_in_frame({kPi, 0.3, 7}, *yaw_of({0, 0, 1}))),
            0.05);
  ASSERT_TRUE(result.shot);
  EXPECT_GT(result.shot->worth, 0.95);
  for (int i = 0; i < 60; ++i) EXPECT_FALSE(world.step(kTick).cut) << "one shot is one cut";
}

TEST(AskedShot, ACutToAPlaceInsideAWallGoesToANearPlaceThatSeesTheTarget) {
  Shown world;
  const glm::dvec3 asked_m = glm::dvec3(0, 1, 0) + offset_in_frame({kPi, 0.3, 7}, *yaw_of({0, 0, 1}));
  world.add_box(9, asked_m, {4, 4, 1});
  world.step(kTick);
  AskedShot there;
  there.side_rad = kPi, there.height_rad = 0.3, there.distance_m = 7, there.cut = true;
  world.ask(there);
  StepResult result;
  for (int i = 0; i < 30 && !result.cut; ++i) result = world.step(kTick);
  ASSERT_TRUE(result.cut);
  EXPECT_GE(world.clearance_m(), world.limits.body_radius_m);
  EXPECT_GT(result.targets[0].visible_share, 0.95);
}

// A booth that is open to one side hides the target from the places near the shot, which all have room. The camera sees
// it all the time. Without the viewpoint search, the order of the places stays as it is.
TEST(AskedShot, ACutLooksBeyondTheFirstPlacesFromWhichTheTargetIsHidden) {
  Shown world({0, 1.2, 4});
  world.settings.move.search_viewpoints = false;
  world.add_box(20, {0, 1.3, -1.2}, {1.3f, 1.3f, 0.05f});
  for (const double x_m : {-1.2, 1.2}) world.add_box(x_m < 0 ? 21 : 22, {x_m, 1.3, 0}, {0.05f, 1.3f, 1.2f});
  world.add_box(23, {0, 2.6, 0}, {1.3f, 0.05f, 1.3f});
  world.step(kTick);
  AskedShot there;
  there.side_rad = kPi / 2, there.height_rad = 0.3, there.distance_m = 5, there.cut = true;
  world.ask(there);
  StepResult result;
  for (int i = 0; i < 30 && !result.cut; ++i) result = world.step(kTick);
  ASSERT_TRUE(result.cut);
  EXPECT_GT(result.targets[0].visible_share, 0.7);
}

TEST(AskedShot, ACutWithoutARequiredTargetStillShowsTheTarget) {
  Shown world;
  world.targets[0].required = false;
  const glm::dvec3 asked_m = glm::dvec3(0, 1, 0) + offset_in_frame({kPi, 0.3, 7}, *yaw_of({0, 0, 1}));
  world.add_box(9, glm::mix(glm::dvec3(0, 1, 0), asked_m, 0.5), {2, 2, 0.3});
  world.step(kTick);
  AskedShot there;
  there.side_rad = kPi, there.height_rad = 0.3, there.distance_m = 7, there.cut = true;
  world.ask(there);
  StepResult result;
  for (int i = 0; i < 30 && !result.cut; ++i) result = world.step(kTick);
  ASSERT_TRUE(result.cut);
  EXPECT_GT(result.targets[0].visible_share, 0.95) << "not behind the wall";
}

TEST(AskedShot, AnOrbitWithABlendBeginsWhereTheCameraIs) {
  Shown world({0, 1.6, 6});
  AskedShot orbit;
  orbit.orbit_radps = 0.4, orbit.blend_s = 5;
  world.ask(orbit);
  const StepResult result = world.step(kTick);
  ASSERT_TRUE(result.shot);
  EXPECT_LT(glm::distance(glm::dvec3(0, 1, 0) + offset_in_frame(result.shot->asked, *yaw_of({0, 0, 1})),
                          glm::dvec3(0, 1.6, 6)),
            0.1);
}

// Two people stand on a line along +x. From either side of it, the camera takes the shot of that side, and does not
// cross the line. Without the word it goes to the right of the line, wherever it is.
TEST(AskedShot, TheNearerOfTwoSidesThatAreAsGoodIsTaken) {
  for (const double z_m : {6.0, -6.0})
    for (const bool either : {true, false}) {
      Shown world({0.75, 1.6, z_m});
      world.add_target(2, {1.5, 1, 0});
      AskedShot shot;
      shot.frame = ShotFrame::kLine, shot.frame_id = 1, shot.line_to_id = 2;
      shot.side_rad = kPi / 2, shot.height_rad = 0.1, shot.distance_m = 6, shot.either_side = either;
      world.ask(shot);
      const StepResult first = world.step(kTick);
      ASSERT_TRUE(first.shot);
      EXPECT_NEAR(first.shot->asked.side_rad, either && z_m < 0 ? -kPi / 2 : kPi / 2, 1e-9) << z_m << ' ' << either;
      EXPECT_EQ(first.shot->deviation.side < 0.01, either || z_m > 0) << z_m << ' ' << either;
      // The side is chosen once: a line that turns takes the camera with it.
      world.turn_to(2, {-0.2, 1, 1.4}, {0, 0, 0}, {0, 0, 1});
      for (int i = 0; i < 120; ++i) world.step(kTick);
      EXPECT_NEAR(world.step(kTick).shot->asked.side_rad, first.shot->asked.side_rad, 1e-9);
    }
}

TEST(AskedShot, TwoPeopleKeepTheirSizeAllRoundAnOrbit) {
  Shown world({0, 1.6, 8});
  world.add_target(2, {3, 1, 0});
  AskedShot orbit;
  orbit.orbit_radps = 0.35, orbit.height_rad = 0.35, orbit.size = 0.4, orbit.weight = 3;
  world.ask(orbit);
  Watch watch(world);
  double largest = 0, smallest = 1;
  for (int i = 0; i < 1080; ++i) {
    watch.step();
    if (i < 240) continue;
    glm::dvec2 low(1e9), high(-1e9);
    for (const double x_m : {0.0, 3.0})
      for (const double y_m : {0.1, 1.9}) {
        const glm::dvec2 at = world.in_halves({x_m, y_m, 0});
        low = glm::min(low, at), high = glm::max(high, at);
      }
    const double size = std::max(high.x - low.x, high.y - low.y) / 2;
    largest = std::max(largest, size), smallest = std::min(smallest, size);
  }
  EXPECT_LT(largest, 0.6);
  EXPECT_GT(smallest, 0.25);
}

TEST(AskedShot, ARunnerWhoStandsStillKeepsTheDirectionOfTheFormerShot) {
  Shown world({-5, 1.8, 0});
  AskedShot chase;
  chase.frame = ShotFrame::kTravel, chase.side_rad = kPi, chase.height_rad = 0.15, chase.distance_m = 5;
  world.ask(chase);
  double x_m = 0;
  for (int i = 0; i < 120; ++i) x_m += 2.0 * kTick, world.move(1, {x_m, 1, 0}, {2, 0, 0}), world.step(kTick);
  for (int i = 0; i < 60; ++i) world.move(1, {x_m, 1, 0}), world.step(kTick);
  chase.distance_m = 4;
  world.ask(chase);
  StepResult result;
  for (int i = 0; i < 240; ++i) result = world.step(kTick);
  EXPECT_LT(glm::distance(world.camera().pose.position_m,
                          glm::dvec3(x_m, 1, 0) + offset_in_frame({kPi, 0.15, 4}, *yaw_of({1, 0, 0}))),
            0.5);
}

TEST(AskedShot, FromRightAboveASideThatIsNotSentStays) {
  Shown world({0, 9, 0.5});
  world.settings.move.max_elevation_rad = kPi / 2;
  AskedShot above;
  above.side_rad = 2.0, above.height_rad = kPi / 2, above.distance_m = 8;
  world.ask(above);
  for (int i = 0; i < 240; ++i) world.step(kTick);
  AskedShot nearer;
  nearer.distance_m = 6;
  world.ask(nearer);
  const StepResult result = world.step(kTick);
  ASSERT_TRUE(result.shot);
  EXPECT_NEAR(result.shot->asked.side_rad, 2.0, 1e-6);
}

TEST(AskedShot, AnObservedCutDoesNotBringBackACutToTheShot) {
  Shown world;
  AskedShot there;
  there.side_rad = kPi, there.height_rad = 0.3, there.distance_m = 7, there.cut = true;
  world.ask(there);
  world.step(kTick);
  world.place({0, 1.6, 5}, {0, 1, 0});
  for (int i = 0; i < 60; ++i) EXPECT_FALSE(world.step(kTick).cut);
}

TEST(AskedShot, ABlendTakesItsTime) {
  Shown world({0, 1.6, 6});
  world.step(kTick);
  AskedShot there;
  there.side_rad = 1.2, there.height_rad = 0.6, there.distance_m = 9, there.blend_s = 3;
  world.ask(there);
  Watch watch(world);
  double last = 0;
  for (int i = 0; i < 360; ++i) {
    StepResult result;
    world.step_in(watch, result);
    ASSERT_TRUE(result.shot);
    EXPECT_GE(result.shot->asked.height_rad, last - 1e-9);
    if (i == 90) {
      EXPECT_NEAR(result.shot->asked.side_rad, 0.6, 0.05) << "half way";
    }
    last = result.shot->asked.height_rad;
  }
  EXPECT_NEAR(last, 0.6, 1e-9);
  EXPECT_LT(glm::distance(world.camera().pose.position_m,
                          glm::dvec3(0, 1, 0) + offset_in_frame({1.2, 0.6, 9}, *yaw_of({0, 0, 1}))),
            0.3);
}

TEST(AskedShot, WhatIsNotSentIsTakenFromTheFormerShotEvenWhileTheCameraEvades) {
  Shown world({0, 1.6, 6});
  AskedShot first;
  first.side_rad = 0.0, first.height_rad = 0.1, first.distance_m = 6;
  world.ask(first);
  world.add_box(9, {0, 2, 3}, {2, 2, 0.2});
  for (int i = 0; i < 240; ++i) world.step(kTick);
  AskedShot nearer;
  nearer.distance_m = 4;
  world.ask(nearer);
  const StepResult result = world.step(kTick);
  ASSERT_TRUE(result.shot);
  EXPECT_NEAR(result.shot->asked.side_rad, 0.0, 1e-9);
  EXPECT_NEAR(result.shot->asked.height_rad, 0.1, 1e-9);
  EXPECT_NEAR(result.shot->asked.distance_m, 4.0, 1e-9);
}

TEST(AskedShot, TheEvadingCameraComesBackAfterATargetJoinedAndLeft) {
  Shown world({0, 1.6, 6});
  const glm::dvec3 asked_m = world.camera().pose.position_m;
  world.add_box(9, {0, 2, 3}, {2, 2, 0.2});
  Watch watch(world);
  for (int i = 0; i < 300; ++i) watch.step();
  EXPECT_GT(glm::distance(world.camera().pose.position_m, asked_m), 1.0) << "it evades the wall";
  world.add_target(2, {1.5, 1, 0});
  for (int i = 0; i < 60; ++i) watch.step();
  world.targets.pop_back();
  for (int i = 0; i < 60; ++i) watch.step();
  SceneDelta gone;
  gone.remove = {9};
  ASSERT_TRUE(world.mirror.apply(gone, {}));
  for (int i = 0; i < 900; ++i) watch.step();
  EXPECT_LT(glm::distance(world.camera().pose.position_m, asked_m), 0.3);
}

TEST(AskedShot, TheReportNamesWhatHidesTheTargetFromThePlaceOfTheShot) {
  Shown world({0, 1.6, 6});
  Watch watch(world);
  StepResult result;
  for (int i = 0; i < 120; ++i) result = watch.step();
  ASSERT_TRUE(result.shot);
  EXPECT_GT(result.shot->worth, 0.99);
  EXPECT_EQ(result.shot->hidden_by, 0u);
  EXPECT_EQ(result.shot->limits, 0u);
  world.add_box(9, {0, 2, 3}, {2, 2, 0.2});
  for (int i = 0; i < 600; ++i) result = watch.step();
  ASSERT_TRUE(result.shot);
  EXPECT_GT(result.shot->hidden_share, 0.9);
  EXPECT_EQ(result.shot->hidden_by, 9u);
  EXPECT_EQ(result.shot->hidden_target, 1u);
  EXPECT_GT(result.shot->deviation.side + result.shot->deviation.height + result.shot->deviation.size, 0.0)
      << "it evades";
}

// A walker at 1.5 m/s is filmed from the side, 5 m away, and passes behind a pillar of 0.6 m that stands half way. The
// middle of the walker is hidden from the place of the shot, which goes along, while it is less than 0.3 m from the
// pillar.
TEST(AskedShot, TheReportForeseesWhatWillHideAWalker) {
  constexpr double kSpeedMps = 1.5, kPillarM = 6.0;
  Shown world({0, 1.6, 5});
  world.add_box(9, {kPillarM, 2, 2.5}, {0.3, 2, 0.05});
  Watch watch(world);
  int told = 0;
  for (int i = 0; i < 400; ++i) {
    const double x_m = kSpeedMps * i * kTick, hidden_in_s = (kPillarM - 0.3 - x_m) / kSpeedMps;
    world.move(1, {x_m, 1, 0}, {kSpeedMps, 0, 0});
    const StepResult result = watch.step();
    ASSERT_TRUE(result.shot);
    if (i < 60) continue;  // the camera and the shot are still getting to their pace
    EXPECT_LT(glm::distance(result.shot->place_m, glm::dvec3(x_m, 1.6, 5)), 0.1) << i;
    if (hidden_in_s > 1.35 || x_m > kPillarM + 0.5) {
      EXPECT_EQ(result.shot->soon_by, 0u) << i;
    }
    if (hidden_in_s > 1.1 || hidden_in_s < 0.15) continue;
    EXPECT_EQ(result.shot->soon_by, 9u) << i;
    EXPECT_EQ(result.shot->soon_target, 1u) << i;
    EXPECT_NEAR(result.shot->soon_s, hidden_in_s, 0.12) << i;
    ++told;
  }
  EXPECT_GT(told, 50);
}

TEST(AskedShot, TheReportForeseesSomebodyElseWhoComesBetween) {
  Shown world({0, 1.6, 6});
  world.add_box(9, {-6, 1.4, 3}, {0.25, 1.4, 0.25});
  Watch watch(world);
  int told = 0;
  for (int i = 0; i < 240; ++i) {
    const double x_m = -6 + 1.5 * i * kTick, hidden_in_s = (-0.25 - x_m) / 1.5;
    world.move(9, {x_m, 1.4, 3}, {1.5, 0, 0});
    const StepResult result = watch.step();
    ASSERT_TRUE(result.shot);
    if (i < 30 || hidden_in_s < 0.15) continue;
    if (hidden_in_s > 1.35) {
      EXPECT_EQ(result.shot->soon_by, 0u) << i;
    }
    if (hidden_in_s > 1.1) continue;
    EXPECT_EQ(result.shot->soon_by, 9u) << i;
    EXPECT_EQ(result.shot->soon_target, 1u) << i;
    EXPECT_NEAR(result.shot->soon_s, hidden_in_s, 0.12) << i;
    ++told;
  }
  EXPECT_GT(told, 50);
}

// Of two people who walk in file past a pillar, each is foretold to be hidden in turn, at every rate of the ticks.
TEST(AskedShot, TheReportForeseesWhatWillHideEachOfTwo) {
  for (const double rate_hz : {60.0, 30.0, 15.0}) {
    Shown world({0, 1.6, 6});
    world.add_target(2, {-1.5, 1, 0});
    world.add_box(9, {5, 2, 2.5}, {0.6, 2, 0.05});
    Watch watch(world);
    std::array<int, 2> due{}, told{};
    for (int i = 0; i < 5 * rate_hz; ++i) {
      const double x_m = 1.5 * i / rate_hz;
      world.move(1, {x_m, 1, 0}, {1.5, 0, 0}), world.move(2, {x_m - 1.5, 1, 0}, {1.5, 0, 0});
      const StepResult result = watch.step(1 / rate_hz);
      ASSERT_TRUE(result.shot);
      if (i < rate_hz) continue;
      // The nearer one is hidden first; while it is, the other one is next.
      const glm::dvec3 place_m = result.shot->place_m;
      const auto hidden_in_s = [&](double at_m) { return (4.4 - std::lerp(at_m, place_m.x, 2.5 / place_m.z)) / 1.5; };
      const double first_s = hidden_in_s(x_m), second_s = hidden_in_s(x_m - 1.5);
      // By 0.15 s later all of it is hidden.
      const size_t next = first_s > 0 ? 0 : 1;
      const double in_s = next == 0 ? first_s : second_s;
      if (in_s > 1.0 || in_s < 0.2 || (next == 1 && first_s > -0.15)) continue;
      ++due[next];
      told[next] += result.shot->soon_target == next + 1 && result.shot->soon_by == 9 &&
                    std::abs(result.shot->soon_s - in_s) < 0.2;
    }
    for (const size_t k : {0u, 1u}) {
      EXPECT_GT(due[k], rate_hz / 8) << rate_hz << " Hz, target " << k + 1;
      EXPECT_GE(told[k], 0.8 * due[k]) << rate_hz << " Hz, target " << k + 1;
    }
  }
}

TEST(AskedShot, TheReportNamesTheLimitsThatTheShotBreaks) {
  Shown world({0, 1.6, 6});
  const auto limits_with = [&](double height_rad, double distance_m) {
    AskedShot asked;
    asked.height_rad = height_rad, asked.distance_m = distance_m;
    world.ask(asked);
    const StepResult result = world.step(kTick);
    EXPECT_TRUE(result.shot);
    return result.shot ? result.shot->limits : 0u;
  };
  const auto only = [](ShotLimit limit) { return 1u << static_cast<int>(limit); };
  EXPECT_EQ(limits_with(0.1, 6), 0u);
  EXPECT_EQ(limits_with(0.1, 50), only(ShotLimit::kMaxDistance));
  EXPECT_EQ(limits_with(1.5, 6), only(ShotLimit::kMaxElevation));
  EXPECT_EQ(limits_with(-0.8, 6), only(ShotLimit::kMinElevation));
  EXPECT_EQ(limits_with(0.1, 0.6), only(ShotLimit::kMinDistance) | only(ShotLimit::kPicture));
  EXPECT_EQ(limits_with(0.1, 1.5), only(ShotLimit::kPicture));
}

TEST(AskedShot, ABodyThatIsLessThanHalfInThePictureIsNotTracked) {
  // Held where it is, so near that only a part of the body fits.
  Shown world;
  world.settings.move.follow = Follow::kStay;
  world.settings.move.min_distance_m = 0;
  world.limits.max_speed_mps = 1e-6;
  world.place({0, 1.4, 0.75}, {0, 1.4, 0});
  StepResult result;
  for (int i = 0; i < 60; ++i) result = world.step(kTick);
  ASSERT_TRUE(result.targets[0].in_picture);
  ASSERT_GT(result.targets[0].filtered_share, 0.75);
  ASSERT_LT(result.targets[0].picture_share, 0.5);
  EXPECT_EQ(result.status, TrackingStatus::kPartialView);
}

}  // namespace
}  // namespace sightline::test
