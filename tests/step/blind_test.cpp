// A camera that sees nobody and has no plan that shows anybody takes a way through the whole level; one that sees a
// part of its targets does not leave it.
#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "tests/support/filming.h"

namespace sightline::test {
namespace {

// A shaft with openings on two storeys, seen from the side. The target stands on the ground floor. The camera is above
// a slab in the shaft, so its way leads out on the upper storey, over the edge of the gallery and down:
//
//   y = 8   |      |
//           |      |
//   y = 12.3|      #
//           |camera        opening
//   y = 10  |      #################  gallery
//   y = 2.5 |######|
//           |target        opening
//   y = 0   ########################################
struct Shaft : OneFilmed {
  Shaft() : OneFilmed({0, 3.2, 1.3}) {
    move(1, {0, 0.9, 1.3});
    place({0, 3.2, 1.3}, {0, 3.2, -3});
    add_box(9, {0, -0.5, 0}, {40, 0.5, 40});
    add_box(10, {-1.4, 10, 1.3}, {0.1, 10, 1.5});
    add_box(11, {1.4, 10, 1.3}, {0.1, 10, 1.5});
    add_box(12, {0, 10, 2.7}, {1.5, 10, 0.1});
    add_box(13, {0, 2.4, 1.3}, {1.3, 0.1, 1.3});   // the slab
    add_box(14, {0, 20.1, 1.3}, {1.5, 0.1, 1.5});  // the roof of the shaft
    for (uint64_t side : {0, 1}) add_box(15 + side, {side == 0 ? -1.1 : 1.1, 10, -0.1}, {0.3, 10, 0.1});
    add_box(17, {0, 6.15, -0.1}, {0.8, 3.85, 0.1});   // above the lower opening
    add_box(18, {0, 16.15, -0.1}, {0.8, 3.85, 0.1});  // above the upper one
    add_box(19, {0, 9.9, -4.2}, {8, 0.1, 4.0});       // the gallery
  }
};

TEST(Blind, TheCameraLeavesAShaftByTheUpperStoreyToSeeTheLowerOne) {
  Shaft world;
  Watch watch(world);
  StepResult r;
  int seen_at = -1;
  for (int i = 0; i < 1500 && seen_at < 0; ++i) {
    world.step_in(watch, r);
    if (r.targets[0].filtered_share > 0.9) seen_at = i;
  }
  EXPECT_GE(seen_at, 0) << "the target was never seen whole; the camera is at " << world.camera().pose.position_m.x
                        << ", " << world.camera().pose.position_m.y << ", " << world.camera().pose.position_m.z;
  EXPECT_LT(world.camera().pose.position_m.z, 0) << "in front of the lower opening";
}

TEST(Blind, OnItsWayItSaysThatItSeeksAndHowLongItTakes) {
  Shaft world;
  Watch watch(world);
  StepResult r;
  int seeking = 0;
  for (int i = 0; i < 200; ++i) {
    world.step_in(watch, r);
    if (i < 100) continue;
    seeking += r.status == TrackingStatus::kSeeking && r.view_s && *r.view_s > 0.5;
  }
  EXPECT_GT(seeking, 60);
}

// Two people walk side by side through two rows of rooms with walls 5 m high. The doors of a row are in one line. The
// camera is in a door behind the first person. Without a roof, both are in sight only from high above; the other row
// can have one.
struct Rooms : Filming {
  static constexpr double kRoomM = 6, kHalfWallM = 2.5, kDoorM = 1.4, kDoorHeightM = 2.4;
  explicit Rooms(bool other_is_roofed) {
    add_target(1, {1, 0.9, 3});
    add_target(2, {1, 0.9, -3});
    add_box(9, {24, -0.5, 0}, {40, 0.5, 20});
    uint64_t id = 10;
    for (const double z : {-6.0, 0.0, 6.0}) add_box(id++, {24, kHalfWallM, z}, {30, kHalfWallM, 0.1});
    for (double x = 0; x < 50; x += kRoomM)
      for (const double z : {-3.0, 3.0})
        for (const double side : {-1.0, 1.0}) {
          const double half_m = (kRoomM / 2 - kDoorM / 2) / 2;
          add_box(id++, {x, kHalfWallM, z + side * (kDoorM / 2 + half_m)}, {0.1, kHalfWallM, half_m});
        }
    for (double x = 0; x < 50; x += kRoomM)
      for (const double z : {-3.0, 3.0})
        add_box(id++, {x, kHalfWallM + kDoorHeightM / 2, z}, {0.1, kHalfWallM - kDoorHeightM / 2, kDoorM / 2});
    if (other_is_roofed) add_box(id++, {24, 2 * kHalfWallM + 0.1, -3}, {30, 0.1, 3});
    place({-2, 1.6, 3}, {0, 1.2, 3});
    // judged is the way, not the pace
    settings.move.decide_every_s = 0;
  }
  StepResult walk() {
    x_m += kMps / 60;
    move(1, {1 + x_m, 0.9, 3}, {kMps, 0, 0}), move(2, {1 + x_m, 0.9, -3}, {kMps, 0, 0});
    return step(1.0 / 60);
  }
  static constexpr double kMps = 1.4;
  double x_m = 0;
};

// The two come through an open yard into the rows.
TEST(Blind, ACameraGoesToWhereItWillSeeBothWhenItExpectsToLoseOne) {
  Rooms world(false);
  world.x_m = -5;
  world.place({-8, 2, 0}, {-4, 1.2, 0});
  int seen = 0;  // steps before the first loss
  for (; seen < 60 * 13; ++seen) {
    const StepResult r = world.walk();
    if (r.targets[0].filtered_share < 0.5 || r.targets[1].filtered_share < 0.5) break;
  }
  EXPECT_GT(seen, 120);
}

// It does not leave the one that it sees to fly over the walls, and follows through the doors.
TEST(Blind, ACameraStaysWithTheOneThatItSees) {
  for (const bool other_is_roofed : {false, true}) {
    Rooms world(other_is_roofed);
    int first = 0;
    for (int i = 0; i < 600; ++i) {
      const StepResult r = world.walk();
      if (i >= 120) first += r.targets[0].visible_share > 0.5;
    }
    EXPECT_GT(first, 400) << "of 480 steps";
  }
}

// Two people walk into a tunnel one behind the other. It is too narrow for the camera, which loses sight of one of them
// wherever it is.
struct Tunnel : OneFilmed {
  Tunnel(double half_width_m, double speed_mps) : OneFilmed({-4, 2.5, 3}), mps(speed_mps) {
    settings.move.decide_every_s = 0;  // so that every step has a plan
    add_target(2, {-1.5, 1, 0});
    add_box(9, {0, -0.1, 0}, {80, 0.1, 80});
    for (const double side : {-1.0, 1.0})
      add_box(side < 0 ? 10 : 11, {25, 1.25, side * (half_width_m + 0.1)}, {15, 1.25, 0.1});
    add_box(12, {25, 2.6, 0}, {15, 0.1f, static_cast<float>(half_width_m + 0.2)});
  }
  void walk() {
    x_m += mps / 60;
    move(1, {x_m, 1, 0}, {mps, 0, 0}), move(2, {x_m - 1.5, 1, 0}, {mps, 0, 0});
    step(1.0 / 60);
  }
  // True if the plan ends at a place that is so new to the bound that the plan's last slice is not known of it.
  bool plan_ends_at_new_place() const {
    const auto& plan_m = stepper.dump().decision.plan_m;
    if (plan_m.empty()) return false;
    const CandidateMemory& memory = stepper.carried().candidates;
    const std::vector<glm::dvec3> cells_m = memory.lattice.positions_m();
    const auto from_end_m = [&](const glm::dvec3& cell_m) {
      return glm::distance(cell_m, plan_m[plan_m.size() - 1].position_m);
    };
    const auto nearest = std::ranges::min_element(cells_m, {}, from_end_m);
    return memory.ahead.shares(kSlices -
                               1)[memory.lattice.addresses()[static_cast<size_t>(nearest - cells_m.begin())]] ==
           kUnknownShare;
  }
  const double mps;
  double x_m = 0;
};

TEST(Blind, BeforeALossEverywhereTheCameraDoesNotChaseTheEdgeOfTheBound) {
  int chases = 0, steps = 0;
  for (const double mps : {1.5, 2.5})
    for (const double half_width_m : {0.42, 0.6}) {
      Tunnel world(half_width_m, mps);
      while (world.x_m < 7) world.walk();
      for (; world.x_m < 13; ++steps) world.walk(), chases += world.plan_ends_at_new_place();
    }
  EXPECT_LT(chases, 120) << "of " << steps << " steps";
  EXPECT_GT(steps, 600);
}

}  // namespace
}  // namespace sightline::test
