#include "server/move/picture_worth.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

namespace sightline {
namespace {

double rad(double degrees) {
  return degrees * std::numbers::pi / 180;
}
glm::dvec3 offset_m(double side_deg, double height_deg, double distance_m) {
  const double level = std::cos(rad(height_deg));
  return distance_m *
         glm::dvec3(level * std::sin(rad(side_deg)), std::sin(rad(height_deg)), level * std::cos(rad(side_deg)));
}
ShotDeviation deviation(const glm::dvec3& asked_m, const glm::dvec3& now_m) {
  return deviation_between(shot_from(asked_m, 1.0), shot_from(now_m, 1.0));
}

TEST(PictureWorth, NothingIsLostWithinTheFreeBands) {
  const ShotDeviation free = deviation(offset_m(170, 10, 6), offset_m(-161, 19, 7));
  EXPECT_EQ(shot_loss(free, {}), 0);
  EXPECT_EQ(picture_worth(0, 0), 1);
}

TEST(PictureWorth, EachPropertyLosesItsWeightAtItsLimit) {
  const glm::dvec3 asked_m = offset_m(0, 10, 6);
  const ShotWeights weights{.side = 0.1, .height = 0.2, .size = 0.4, .place = 0.3};
  EXPECT_NEAR(shot_loss(deviation(asked_m, offset_m(120, 10, 6)), weights), 0.1, 1e-9);
  EXPECT_NEAR(shot_loss(deviation(asked_m, offset_m(0, 55, 6)), weights), 0.2, 1e-9);
  EXPECT_NEAR(shot_loss(deviation(asked_m, offset_m(0, 10, 6 * std::exp2(-1.5))), weights), 0.4, 1e-9);
  EXPECT_NEAR(shot_loss(deviation(asked_m, offset_m(0, 10, 6 * std::exp2(-5))), weights), 0.4, 1e-9)
      << "no more beyond it";
  EXPECT_NEAR(unbounded_shot_loss(deviation(asked_m, offset_m(0, 10, 6 * std::exp2(-5))), weights), 0.4 * 4.75 / 1.25,
              1e-9)
      << "a search has a way back";
}

TEST(PictureWorth, IsNeverLessThanNothing) {
  EXPECT_EQ(picture_worth(0.7, 0.6), 0);
  EXPECT_NEAR(picture_worth(0.25, 0.25), 0.5, 1e-12);
}

TEST(PictureWorth, ManyPlacesAreAsEachOne) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> side(-180, 180), height(-85, 85), octaves(-4, 4);
  const glm::dvec3 center_m(11, -3, 40), box_m(5, 5, 5);
  for (const glm::dvec3& asked_m :
       {offset_m(30, 12, 6), offset_m(-170, -20, 0.5), offset_m(0, 89, 25), glm::dvec3(0, 4, 0)}) {
    std::vector<glm::dvec3> now_m{{0, 3, 0}, {0, -3, 0}, {1e-3, 0, 0}};
    while (now_m.size() < 2001) now_m.push_back(offset_m(side(random), height(random), 6 * std::exp2(octaves(random))));
    std::vector<float> x, y, z, losses(now_m.size(), -1.0f);
    for (const glm::dvec3& at_m : now_m) {
      const glm::vec3 from_box(center_m + at_m - box_m);
      x.push_back(from_box.x), y.push_back(from_box.y), z.push_back(from_box.z);
    }
    unbounded_shot_losses({x.data(), y.data(), z.data(), x.size(), glm::vec3(center_m - box_m)}, asked_m, {},
                          losses.data());
    for (size_t i = 0; i < now_m.size(); ++i) {
      if (std::hypot(now_m[i].x, now_m[i].z) < 1e-2) continue;  // the place has nearly no side
      EXPECT_NEAR(losses[i], unbounded_shot_loss(deviation(asked_m, now_m[i]), {}), 2e-3) << i;
    }
  }
}

}  // namespace
}  // namespace sightline
