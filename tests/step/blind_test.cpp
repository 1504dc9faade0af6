// A camera that has seen nobody for long takes a way through the whole level.
#include <gtest/gtest.h>

#include "tests/support/filming.h"

namespace sightline::test {
namespace {

// A shaft with openings on two storeys, seen from the side. The target stands on the ground floor. The camera is above a slab in the shaft, so its way leads out on the
// upper storey, over the edge of the gallery and down:
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
    add_box(13, {0, 2.4, 1.3}, {1.3, 0.1, 1.3});    // the slab
    add_box(14, {0, 20.1, 1.3}, {1.5, 0.1, 1.5});   // the roof of the shaft
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
  EXPECT_GE(seen_at, 0) << "the target was never seen whole; the camera is at " << world.camera().pose.position_m.x << ", "
                        << world.camera().pose.position_m.y << ", " << world.camera().pose.position_m.z;
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

}  // namespace
}  // namespace sightline::test
