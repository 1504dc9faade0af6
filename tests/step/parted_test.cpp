// Targets that part farther than one picture holds. The camera keeps the targets of the greatest weight, required
// ones first. It returns to all of them when it can.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "tests/support/filming.h"

namespace sightline::test {
namespace {

constexpr double kTick = 1.0 / 60;

struct Person {
  bool required;
  double weight;
};

// Two people walk apart, stay there, and come back.
struct Parting : Filming {
  Parting(const Person& left, const Person& right) {
    add_target(1, {-1, 0.9, 0}, left.required, left.weight);
    add_target(2, {1, 0.9, 0}, right.required, right.weight);
    place({0, 1.6, 6}, {0, 1, 0});
  }
  // `left` and `right`: the speeds at which they leave.
  StepResult walk(double left_mps, double right_mps) {
    left_m += left_mps * kTick, right_m += right_mps * kTick;
    move(1, {-1 - left_m, 0.9, 0}, {-left_mps, 0, 0}), move(2, {1 + right_m, 0.9, 0}, {right_mps, 0, 0});
    const StepResult r = step(kTick);
    const bool gives_up[2] = {r.targets[0].given_up, r.targets[1].given_up};
    EXPECT_FALSE(gives_up[0] && gives_up[1]);
    for (int i : {0, 1}) ever_gave_up[i] |= gives_up[i];
    if (gives_up[0] != gave_up[0] || gives_up[1] != gave_up[1]) ++changes, changed_at.push_back(steps);
    gave_up[0] = gives_up[0], gave_up[1] = gives_up[1];
    shows_nobody += !r.targets[0].in_picture && !r.targets[1].in_picture;
    if (std::max(r.targets[0].picture_share, r.targets[1].picture_share) < 0.05) little_at.push_back(steps);
    ++steps;
    return r;
  }
  double left_m = 0, right_m = 0;
  int changes = 0, shows_nobody = 0, steps = 0;
  std::vector<int> changed_at,
      little_at;  // steps: a target is given up or taken back; hardly anybody is in the picture
  bool gave_up[2] = {}, ever_gave_up[2] = {};
};

void expect_shown_alone(const StepResult& r, size_t shown) {
  EXPECT_TRUE(r.targets[shown].in_picture);
  EXPECT_EQ(r.targets[shown].picture_share, 1.0);
  EXPECT_GE(r.targets[shown].filtered_share, 0.75);
  EXPECT_FALSE(r.targets[shown].given_up);
  EXPECT_TRUE(r.targets[1 - shown].given_up);
  EXPECT_LT(r.targets[shown].distance_m, 12) << "it is shown as near as before";
}

TEST(Parted, TheHeavierIsKeptThenTheRequiredOne) {
  struct Case {
    Person left, right;
    size_t kept;
  };
  for (const Case& c : {Case{{true, 2}, {true, 1}, 0}, Case{{true, 1}, {true, 1.5}, 1}, Case{{false, 3}, {true, 1}, 1},
                        Case{{true, 1}, {false, 3}, 0}, Case{{false, 1}, {false, 3}, 1}}) {
    SCOPED_TRACE(testing::Message() << c.left.required << ' ' << c.left.weight << ", " << c.right.required << ' '
                                    << c.right.weight);
    Parting world(c.left, c.right);
    StepResult r;
    for (int i = 0; i < 60 * 16; ++i) r = world.walk(4, 4);
    for (int i = 0; i < 60 * 4; ++i) r = world.walk(0, 0);
    expect_shown_alone(r, c.kept);
    const bool other_is_required = (c.kept == 0 ? c.right : c.left).required ||
                                   !(c.kept == 0 ? c.left : c.right).required;
    EXPECT_EQ(r.status, other_is_required ? TrackingStatus::kPartialView : TrackingStatus::kTracking);
    EXPECT_FALSE(world.ever_gave_up[c.kept]);
    EXPECT_LE(world.changes, 3)
        << "the other one is given up, perhaps shown from in line for a while, and given up again";
  }
}

TEST(Parted, OfEqualOnesTheNearerIsKeptAndNoOtherUntilTheyMeetAgain) {
  Parting world({true, 1}, {true, 1});
  StepResult r;
  for (int i = 0; i < 60 * 12; ++i) r = world.walk(0.5, 6);  // the right one leaves for good
  for (int i = 0; i < 60 * 10; ++i) r = world.walk(0, 0);
  const size_t kept = r.targets[0].given_up ? 1 : 0;
  EXPECT_LE(world.changes, 3) << "one is given up while the camera goes into line, and when no place holds both";
  expect_shown_alone(r, kept);
  EXPECT_EQ(r.status, TrackingStatus::kPartialView);
  world.ever_gave_up[kept] = false;
  for (int i = 0; i < 60 * 12; ++i) r = world.walk(-0.5, -6);
  for (int i = 0; i < 60 * 4; ++i) r = world.walk(0, 0);
  EXPECT_FALSE(world.ever_gave_up[kept]);
  EXPECT_LE(world.changes, 6) << "as on the way out";
  EXPECT_FALSE(r.targets[0].given_up || r.targets[1].given_up);
  EXPECT_EQ(r.status, TrackingStatus::kTracking);
}

// People 44 m apart do not fit a picture from the side: the camera is 30 m from their centre at most.
StepResult stand_far_apart(Parting& world) {
  StepResult r;
  for (int i = 0; i < 60 * 7; ++i) r = world.walk(3, 3);
  for (int i = 0; i < 60 * 4; ++i) r = world.walk(0, 0);
  return r;
}

TEST(Parted, BothAreShownFromAPlaceInLineWithThem) {
  Parting world({true, 1}, {true, 1});
  const StepResult r = stand_far_apart(world);
  for (const TargetSight& sight : r.targets) {
    EXPECT_EQ(sight.picture_share, 1.0);
    EXPECT_GE(sight.filtered_share, 0.75);
  }
  EXPECT_EQ(r.status, TrackingStatus::kTracking);
  EXPECT_LE(world.changes, 2) << "one is left out on the way into line";
  EXPECT_GT(std::abs(world.camera().pose.position_m.x), 15) << "it is at the side of one of them";
}

TEST(Parted, ACameraThatKeepsItsSideGivesOneUp) {
  Parting world({true, 1}, {true, 1});
  world.settings.move.search_viewpoints = false;
  const StepResult r = stand_far_apart(world);
  expect_shown_alone(r, r.targets[0].given_up ? 1 : 0);
  EXPECT_EQ(world.changes, 1);
}

// Walls stand behind them, out of the camera's way to their sides.
void add_wall(Parting& world, double side) {
  world.add_box(side < 0 ? 10 : 11, {side * 24, 6, 0}, {0.2f, 6, 12});
}

TEST(Parted, ALineBehindWallsIsNotTakenUntilTheyAreGone) {
  Parting world({true, 1}, {true, 1});
  for (const double side : {-1.0, 1.0}) add_wall(world, side);
  StepResult r = stand_far_apart(world);
  expect_shown_alone(r, r.targets[0].given_up ? 1 : 0);
  EXPECT_EQ(world.changes, 1);
  world.shows_nobody = 0;
  for (int i = 0; i < 60 * 30; ++i) world.walk(0, 0);
  EXPECT_EQ(world.shows_nobody, 0) << "it tries the line again every 10 s, and does not lose sight for that";
  for (const uint64_t wall : {10, 11}) world.move(wall, {0, -100, 0}, {0, 0, 0});
  for (int i = 0; i < 60 * 25; ++i) r = world.walk(0, 0);
  EXPECT_FALSE(r.targets[0].given_up || r.targets[1].given_up);
  EXPECT_EQ(r.status, TrackingStatus::kTracking);
}

TEST(Parted, TheEndThatSeesBothIsTaken) {
  for (const double side : {-1.0, 1.0}) {
    Parting world({true, 1}, {true, 1});
    add_wall(world, side);
    const StepResult r = stand_far_apart(world);
    for (const TargetSight& sight : r.targets) EXPECT_GE(sight.filtered_share * sight.picture_share, 0.75);
    EXPECT_LT(side * world.camera().pose.position_m.x, -15);
  }
}

// The clock stands still while a third person is added and another one is taken away.
TEST(Parted, TargetsChangeWhileTheClockStandsStill) {
  Parting world({true, 1}, {true, 1});
  stand_far_apart(world);
  world.add_target(3, {0, 0.9, -3});
  EXPECT_EQ(world.step(0.0).targets.size(), 3u);
  world.targets.erase(world.targets.begin());
  EXPECT_EQ(world.step(0.0).targets.size(), 2u);
  const StepResult r = world.step(kTick);
  EXPECT_FALSE(r.targets[0].given_up || r.targets[1].given_up) << "22 m apart";
}

// On its way to where it can show both, the camera does not look between them.
TEST(Parted, OnePersonIsInThePictureWhileTheyPartAndMeet) {
  for (const auto& [left_mps, right_mps] : {std::pair{4.0, 4.0}, std::pair{0.5, 8.0}}) {
    Parting world({true, 1}, {true, 1});
    for (int i = 0; i < 60 * 8; ++i) world.walk(left_mps, right_mps);
    for (int i = 0; i < 60 * 8; ++i) world.walk(0, 0);
    for (int i = 0; i < 60 * 8; ++i) world.walk(-left_mps, -right_mps);
    for (int i = 0; i < 60 * 4; ++i) world.walk(0, 0);
    EXPECT_LE(world.little_at.size(), 3u) << left_mps << " and " << right_mps << " m/s";
    for (const int little : world.little_at)  // only while it turns from both to one
      EXPECT_TRUE(std::ranges::any_of(world.changed_at, [&](int at) { return std::abs(at - little) <= 6; })) << little;
    EXPECT_LE(world.changes, 2) << "the one that was kept first stays kept";
  }
}

// Two people leave a room without a roof, one by the door in the east, then the other by the door in the south. From
// between the doors both are in sight, but no picture holds both.
struct TwoDoors : Filming {
  static constexpr double kRoomM = 8, kHalfWallM = 2, kHalfDoorM = 0.8, kHalfLintelM = 0.7, kMps = 1.6, kBehindS = 1.2;
  TwoDoors() {
    add_target(1, {5, 0.9, 4}), add_target(2, {4, 0.9, 4});
    add_box(9, {0, -0.5, 0}, {60, 0.5, 60});
    for (const double at_m : {0.0, kRoomM, 2 * kRoomM}) {
      add_wall({at_m, 0, kRoomM / 2}, false, at_m > 0), add_wall({at_m, 0, kRoomM * 3 / 2}, false, false);
      add_wall({kRoomM / 2, 0, at_m}, true, at_m > 0), add_wall({kRoomM * 3 / 2, 0, at_m}, true, false);
    }
    place({1.3, 2, 1.3}, {4.5, 1.1, 4});
  }
  void add_wall(const glm::dvec3& middle_m, bool along_x, bool door) {
    const auto add = [&](double along_m, double up_m, double half_m, double half_height_m) {
      const glm::dvec3 at_m = middle_m + (along_x ? glm::dvec3(along_m, up_m, 0) : glm::dvec3(0, up_m, along_m));
      add_box(id++, at_m, along_x ? glm::vec3(half_m, half_height_m, 0.1) : glm::vec3(0.1, half_height_m, half_m));
    };
    if (!door) return add(0, kHalfWallM, kRoomM / 2, kHalfWallM);
    const double half_m = (kRoomM / 2 - kHalfDoorM) / 2;
    for (const double side : {-1.0, 1.0}) add(side * (kHalfDoorM + half_m), kHalfWallM, half_m, kHalfWallM);
    add(0, 2 * kHalfWallM - kHalfLintelM, kHalfDoorM, kHalfLintelM);
  }
  StepResult walk() {
    time_s += kTick;
    const double way_m = kMps * time_s, later_m = kMps * std::max(time_s - kBehindS, 0.0);
    move(1, {5 + way_m, 0.9, 4}, {kMps, 0, 0}), move(2, {4, 0.9, 4 + later_m}, {0, 0, later_m > 0 ? kMps : 0.0});
    return step(kTick);
  }
  uint64_t id = 10;
  double time_s = 0;
};

// How many of 300 steps show some of both.
int steps_with_both(TwoDoors& world) {
  int both = 0;
  for (int i = 0; i < 60 * 5; ++i) {
    const StepResult r = world.walk();
    both += r.targets[0].picture_share > 0.3 && r.targets[1].picture_share > 0.3;
  }
  return both;
}

TEST(Parted, ACameraStepsBackFromTargetsThatLeaveByTwoDoors) {
  TwoDoors world;
  EXPECT_GT(steps_with_both(world), 280);
}

// People have come apart when the gap between them is wide for their own size.
TEST(Parted, ABusWithoutWeightDoesNotChangeWhenPeopleAreApart) {
  TwoDoors world;
  world.add_box(3, {0, 6, -40}, glm::vec3(6));
  Target bus;
  bus.instance_id = 3, bus.weight = 0;
  world.targets.push_back(bus);
  EXPECT_GT(steps_with_both(world), 280);
}

// A camera that stays where it is can only choose where to look.
TEST(Parted, AFixedCameraLooksAtTheHeavierOne) {
  for (const double left : {1.0, 3.0}) {
    Parting world({true, left}, {true, 2});
    world.settings.move.follow = Follow::kStay;
    StepResult r;
    for (int i = 0; i < 60 * 5; ++i) r = world.walk(3, 3);
    for (int i = 0; i < 60 * 2; ++i) r = world.walk(0, 0);
    const size_t heavier = left > 2 ? 0 : 1;
    EXPECT_TRUE(r.targets[heavier].in_picture);
    EXPECT_TRUE(r.targets[1 - heavier].given_up);
    EXPECT_EQ(r.status, TrackingStatus::kPartialView);
    EXPECT_EQ(world.changes, 1);
  }
}

// A weight of 0 is no reason to give anything up, and two of three that stay together outweigh the third.
TEST(Parted, ThoseThatStayTogetherAreKept) {
  Filming world;
  world.add_target(1, {-1, 0.9, 0}), world.add_target(2, {0, 0.9, 0}), world.add_target(3, {1, 0.9, 0});
  world.add_target(4, {0, 0.9, -300}, true, 0);
  world.place({0, 1.6, 8}, {0, 1, 0});
  StepResult r = world.step(kTick);
  for (const TargetSight& sight : r.targets) EXPECT_FALSE(sight.given_up);
  for (int i = 0; i < 60 * 12; ++i) {
    const double x = -1 - std::min(120.0, 12.0 * i * kTick);
    world.move(1, {x, 0.9, 0}, {x > -121 ? -12.0 : 0.0, 0, 0});
    r = world.step(kTick);
  }
  EXPECT_TRUE(r.targets[0].given_up);
  EXPECT_TRUE(r.targets[1].in_picture && r.targets[2].in_picture);
  EXPECT_FALSE(r.targets[1].given_up || r.targets[2].given_up);
  EXPECT_EQ(r.status, TrackingStatus::kPartialView);
}

// They stand beside the picture from the start, and a part of somebody could be shown by turning. The limits allow the
// turn within a third of a second.
TEST(Parted, SomebodyBesideThePictureIsShownByTurning) {
  for (const double apart_m : {10.0, 20.0, 30.0})
    for (const double away_m : {4.0, 6.0, 8.0}) {
      Filming world;
      world.add_target(1, {-apart_m / 2, 1, 0});
      world.add_target(2, {apart_m / 2, 1, 0});
      world.place({0, 1.8, away_m}, {0, 1, 0});
      int nobody = 0;
      for (int i = 0; i < 300; ++i) {
        const StepResult r = world.step(kTick);
        nobody += std::max(r.targets[0].picture_share, r.targets[1].picture_share) < 0.3;
      }
      EXPECT_LE(nobody * kTick, 0.4) << apart_m << " m apart, " << away_m << " m away";
    }
}

}  // namespace
}  // namespace sightline::test
