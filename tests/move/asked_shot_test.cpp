// The geometry of a shot's frame, against plain projections.
#include "server/move/asked_shot.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "server/base/transform.h"

namespace sightline {
namespace {

constexpr double kPi = std::numbers::pi;

TEST(AskedShot, TheSideIsToTheRightOfSomebodyWhoFacesAlongTheFrame) {
  // Somebody faces along -X, which is yaw pi/2. To the right of that is -Z.
  const double yaw = *yaw_of({-1, 0, 0});
  EXPECT_NEAR(yaw, kPi / 2, 1e-12);
  EXPECT_LT(glm::distance(offset_in_frame({0, 0, 2}, yaw), glm::dvec3(-2, 0, 0)), 1e-12) << "0 is in front";
  EXPECT_LT(glm::distance(offset_in_frame({kPi / 2, 0, 2}, yaw), glm::dvec3(0, 0, -2)), 1e-12);
  EXPECT_LT(glm::distance(offset_in_frame({kPi, 0, 2}, yaw), glm::dvec3(2, 0, 0)), 1e-12);
  EXPECT_LT(glm::distance(offset_in_frame({kPi / 2, kPi / 2, 2}, yaw), glm::dvec3(0, 2, 0)), 1e-12);
  EXPECT_FALSE(yaw_of({0, 1, 0}));
  EXPECT_FALSE(yaw_of({0, 0, 0}));
}

TEST(AskedShot, APlaceInAFrameAndItsOffsetAreEachOthersInverse) {
  for (double yaw = -3; yaw < 3; yaw += 0.7)
    for (double side = -3.1; side < 3.1; side += 0.4)
      for (double height = -1.5; height < 1.55; height += 0.3) {
        const PlaceInFrame place = place_in_frame(offset_in_frame({side, height, 7}, yaw), yaw);
        EXPECT_NEAR(std::remainder(place.side_rad - side, 2 * kPi), 0, 1e-9);
        EXPECT_NEAR(place.height_rad, height, 1e-9);
        EXPECT_NEAR(place.distance_m, 7, 1e-9);
      }
}

TEST(AskedShot, ABlendGoesTheShorterWayRoundAndBeginsAndEndsGently) {
  const PlaceInFrame from{3.0, 0.1, 2}, to{-3.0, 0.5, 8};
  double last = 3.0, before = 0, greatest = 0;
  for (int i = 0; i <= 100; ++i) {
    const PlaceInFrame at = blend(from, to, i / 100.0);
    const double turned = std::remainder(at.side_rad - last, 2 * kPi);
    EXPECT_GE(turned, -1e-12) << "by way of pi, not of 0";
    if (i == 1) before = turned;
    greatest = std::max(greatest, turned), last = at.side_rad;
  }
  EXPECT_LT(before, greatest / 10);
  EXPECT_NEAR(blend(from, to, 0.5).distance_m, 4, 1e-9) << "half way between a half and two";
  EXPECT_EQ(blend(from, to, 1.0).side_rad, -3.0);
  EXPECT_EQ(blend(from, to, 0.0).distance_m, 2.0);
}

// The size of upright capsules in a picture, from a ring of points on each.
double size_in_picture(std::span<const TrackedTarget> bodies, const glm::dvec3& eye_m, double side_rad,
                       double height_rad, const Lens& lens) {
  // To the right of somebody who faces along -Z is +X, and the camera looks back.
  const glm::dquat rotation = glm::angleAxis(kPi - side_rad, glm::dvec3(0, 1, 0)) *
                              glm::angleAxis(-height_rad, glm::dvec3(1, 0, 0));
  const Pose camera{eye_m, rotation};
  const double top = std::tan(lens.vertical_fov_rad / 2);
  double left = 1e9, right = -1e9, low = 1e9, high = -1e9;
  for (const TrackedTarget& body : bodies)
    for (double y : {-body.low_m, body.high_m})
      for (double turn = 0; turn < 2 * kPi; turn += 0.1) {
        const glm::dvec3 p = inverse_transform_point(
            camera, body.aim_m + glm::dvec3(body.aside_m * std::cos(turn), y, body.aside_m * std::sin(turn)));
        left = std::min(left, p.x / -p.z), right = std::max(right, p.x / -p.z), low = std::min(low, p.y / -p.z),
        high = std::max(high, p.y / -p.z);
      }
  return std::max((high - low) / (2 * top), (right - left) / (2 * top * lens.aspect));
}

TEST(AskedShot, FromTheDistanceForASizeTheBodiesHaveItInThePicture) {
  Lens lens;
  for (const double spread_m : {0.0, 1.5, 6.0})
    for (const double size : {0.1, 0.25, 0.5})
      for (const double height : {0.0, 0.3, 0.8, 1.57})
        for (const double side : {0.0, 0.6, 1.5}) {
          TrackedTarget one, two;
          one.aim_m = {-spread_m / 2, 1, 0}, two.aim_m = {spread_m / 2, 1, 0};
          for (TrackedTarget* body : {&one, &two}) body->low_m = 0.9, body->high_m = 0.9, body->aside_m = 0.3;
          const TrackedTarget bodies[] = {one, two};
          const glm::dvec3 direction = offset_in_frame({side, height, 1}, 0);
          const double distance_m = distance_for_size_m(size, bodies, {0, 1, 0}, {side, height, 1}, 0, lens);
          const double is = size_in_picture(bodies, glm::dvec3(0, 1, 0) + distance_m * direction, side, height, lens);
          // The rims of the nearer body are nearer than its middle.
          EXPECT_NEAR(is / size, 1, 0.02 + 0.3 / (distance_m - spread_m / 2 - 0.9))
              << spread_m << " m, size " << size << ", height " << height << ", side " << side;
        }
}

}  // namespace
}  // namespace sightline
