// The flags for wishes that a reply gives up: the distance and the elevation of the camera.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/filming.h"

namespace sightline::test {
namespace {

struct Wishes {
  bool distance = false, elevation = false;
};

// Plainly, for one target at `aim_m`, with the same tolerance of 1 mm and 0.001 rad.
Wishes broken(const MoveSettings& settings, const glm::dvec3& aim_m, const glm::dvec3& at_m) {
  const glm::dvec3 from = at_m - aim_m;
  const double distance_m = glm::length(from), elevation_rad = std::asin(from.y / distance_m);
  return {distance_m < settings.min_distance_m - 1e-3 || distance_m > settings.max_distance_m + 1e-3,
          elevation_rad < settings.min_elevation_rad - 1e-3 || elevation_rad > settings.max_elevation_rad + 1e-3};
}

// A drone that is to stay high, opened too low, behind a target that runs away from it.
TEST(GivenUp, AReplySaysWhichWishItBreaks) {
  OneFilmed world({0, 1.6, 6});
  world.settings.move.min_elevation_rad = 0.6, world.settings.move.max_elevation_rad = 1.2;
  world.settings.move.min_distance_m = 4, world.settings.move.max_distance_m = 12;
  int low = 0, high_enough = 0, far = 0, near_enough = 0;
  for (int i = 0; i < 900; ++i) {
    const double x = i < 300 ? 0 : 12.0 / 60 * (i - 300);
    world.move(1, {x, 1, 0}, {i < 300 ? 0.0 : 12.0, 0, 0});
    const StepResult result = world.step(1.0 / 60);
    const Wishes expected = broken(world.settings.move, {x, 1, 0}, result.camera.pose.position_m);
    ASSERT_EQ(result.flags.elevation_given_up, expected.elevation) << i;
    ASSERT_EQ(result.flags.distance_given_up, expected.distance) << i;
    ++(expected.elevation ? low : high_enough), ++(expected.distance ? far : near_enough);
  }
  for (const int count : {low, high_enough, far, near_enough}) EXPECT_GT(count, 10) << "the run shows every case";
}

// The number of ticks, of 1,500, in which a drone that films a walker is below its least elevation. Roofs hide the
// walker from there, and would not from below.
int ticks_too_low(double least_rad, bool with_roofs) {
  OneFilmed world(glm::dvec3(0, 1, 0) + 9.0 * glm::dvec3(0, std::sin(least_rad + 0.1), std::cos(least_rad + 0.1)));
  world.settings.move.min_elevation_rad = least_rad;
  world.settings.move.keep_shot = 0;  // what keeps it up is the limit alone
  if (with_roofs)
    for (uint64_t i = 1; i <= 2; ++i) world.add_box(10 + i, {12.0 * static_cast<double>(i), 4, 0}, {3, 0.1, 4});
  int too_low = 0;
  for (int i = 0; i < 1500; ++i) {
    const double x_m = 1.4 / 60 * i;
    world.move(1, {x_m, 1, 0}, {1.4, 0, 0});
    too_low += broken(world.settings.move, {x_m, 1, 0}, world.step(1.0 / 60).camera.pose.position_m).elevation;
  }
  return too_low;
}

TEST(GivenUp, ADroneKeepsItsLeastElevationAboveAWalkerUnlessRoofsHideIt) {
  for (const double least_rad : {0.6, 0.9, 1.2}) {
    EXPECT_EQ(ticks_too_low(least_rad, false), 0) << least_rad;
    // A camera without the limit is too low in 1,000 and more.
    EXPECT_LT(ticks_too_low(least_rad, true), 600) << least_rad;
  }
}

TEST(GivenUp, NothingIsGivenUpWithoutATarget) {
  OneFilmed world({0, -40, 90});
  EXPECT_TRUE(world.step(1.0 / 60).flags.elevation_given_up);
  world.targets[0].weight = 0;
  const StepResult result = world.step(1.0 / 60);
  EXPECT_FALSE(result.flags.distance_given_up || result.flags.elevation_given_up);
}

}  // namespace
}  // namespace sightline::test
