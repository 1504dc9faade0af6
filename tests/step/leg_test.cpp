// The way to a goal that stands behind a wall: the camera goes round the wall, leg by leg, and never steers straight at
// it.
#include <gtest/gtest.h>

#include "tests/support/filming.h"

namespace sightline::test {
namespace {

// Seen from above, the target north of an L-shaped wall and the camera in the wall's corner, a step from the long arm:
//
//          target
//   |=================
//   |  camera
//   |
//   |
//
// The walls are far higher than the camera may climb, so its one way goes along the long arm and round its end.
struct LShapedWall : OneFilmed {
  LShapedWall() : OneFilmed({kCornerX + 1.5, 1.6, 2.2}) {
    add_box(9, {0, -0.5, 0}, {60, 0.5, 60});
    add_box(10, {(kCornerX + kEndX) / 2, 30, 1.2}, {(kEndX - kCornerX) / 2, 30, 0.2});
    add_box(11, {kCornerX, 30, 6.2}, {0.2, 30, 5.0});
    settings.move.max_elevation_rad = 0.5;
  }
  static constexpr double kCornerX = -2.0, kEndX = 5.0;
};

TEST(Leg, TheCameraGoesRoundAnLShapedWall) {
  LShapedWall world;
  Watch watch(world);
  StepResult r;
  int seen_at = -1;
  for (int i = 0; i < 480 && seen_at < 0; ++i) {
    world.step_in(watch, r);
    if (r.targets[0].visible_share == 1.0) seen_at = i;
  }
  EXPECT_GE(seen_at, 0) << "the target was never seen whole";
  const glm::dvec3 at = world.camera().pose.position_m;
  EXPECT_TRUE(at.x > LShapedWall::kEndX || at.z < 1.2) << "round the end of the long arm: " << at.x << ", " << at.z;
}

}  // namespace
}  // namespace sightline::test
