#include "server/move/picture_fit.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "server/base/transform.h"
#include "server/move/framing.h"

namespace sightline {
namespace {

constexpr Lens kLens{.vertical_fov_rad = 0.7, .aspect = 16.0 / 9.0};

// By how much the picture must be enlarged to show a point, found by trying.
double enlargement(const Pose& world_from_camera, const glm::dvec3& point_m) {
  double least = 0.0, most = 8.0;
  for (int k = 0; k < 40; ++k) {
    const double times = (least + most) / 2;
    const Lens lens{.vertical_fov_rad = 2 * std::atan(times * std::tan(kLens.vertical_fov_rad / 2)), .aspect = kLens.aspect};
    (in_picture(world_from_camera, lens, point_m) ? most : least) = times;
  }
  return most;
}

double reference_share(const glm::dvec3& eye_m, const std::vector<glm::dvec3>& aim_m, const std::vector<double>& weights) {
  glm::dvec3 forward(0.0);
  double all = 0, out = 0;
  for (size_t k = 0; k < aim_m.size(); ++k) {
    if (weights[k] > 0) forward += glm::normalize(aim_m[k] - eye_m);
    all += weights[k];
  }
  Pose pose{eye_m, look_rotation(forward, {0, 1, 0}, {1, 0, 0})};
  if (aim_m.size() > 2) {
    glm::dvec3 low(20.0), high(-20.0);
    for (size_t k = 0; k < aim_m.size(); ++k) {
      const glm::dvec3 p = inverse_transform_point(pose, aim_m[k]);
      const glm::dvec3 at(glm::clamp(glm::dvec2(p) / std::max(-p.z, 1e-6), -20.0, 20.0), 0.0);
      low = glm::min(low, at), high = glm::max(high, at);
    }
    pose.rotation = look_rotation(pose.rotation * glm::dvec3((low.x + high.x) / 2, (low.y + high.y) / 2, -1), {0, 1, 0}, {1, 0, 0});
  }
  for (size_t k = 0; k < aim_m.size(); ++k) out += weights[k] * std::clamp(2 * (enlargement(pose, aim_m[k]) - 1), 0.0, 1.0);
  return std::min(out, all - *std::max_element(weights.begin(), weights.end())) / all;
}

std::vector<float> shares(const std::vector<glm::dvec3>& eye_m, const std::vector<glm::dvec3>& aim_m, const std::vector<double>& weights) {
  PictureFit fit;
  fit.set_places(eye_m);
  std::vector<float> share(eye_m.size(), -1.0f);
  fit.outside_share(aim_m, weights, kLens, share);
  return share;
}

TEST(PictureFit, SharesAreThoseOfAProjection) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> far_m(-12.0, 12.0), weight(0.0, 2.0);
  int partial = 0;
  for (size_t targets = 2; targets <= 5; ++targets) {
    std::vector<glm::dvec3> eye_m, aim_m;
    std::vector<double> weights;
    for (size_t k = 0; k < targets; ++k) aim_m.push_back({300 + far_m(random) / 3, far_m(random) / 12, far_m(random) / 3}), weights.push_back(weight(random));
    for (int k = 0; k < 1000; ++k) eye_m.push_back({300 + far_m(random), far_m(random), far_m(random)});
    const std::vector<float> share = shares(eye_m, aim_m, weights);
    for (size_t k = 0; k < eye_m.size(); ++k) {
      const double expected = reference_share(eye_m[k], aim_m, weights);
      ASSERT_NEAR(share[k], expected, 5e-3) << targets << " targets, place " << k;
      partial += expected > 0.01 && expected < 0.3;
    }
  }
  EXPECT_GT(partial, 50);
}

// Against the test of the aim, which looks for the middle in angles.
TEST(PictureFit, AShareIsNoneWhereTheTargetsFitThePicture) {
  std::mt19937 random(6);
  std::uniform_real_distribution<double> far_m(-12.0, 12.0);
  int fitting = 0, tight = 0;
  for (size_t targets = 2; targets <= 6; ++targets) {
    std::vector<glm::dvec3> eye_m, aim_m;
    std::vector<TrackedTarget> tracked(targets);
    for (TrackedTarget& target : tracked) aim_m.push_back(target.aim_m = {far_m(random) / 2, far_m(random) / 8, far_m(random) / 2});
    for (int k = 0; k < 400; ++k) eye_m.push_back({far_m(random), far_m(random), far_m(random)});
    const std::vector<float> share = shares(eye_m, aim_m, std::vector(targets, 1.0));
    for (size_t k = 0; k < eye_m.size(); ++k) {
      const bool fits = fits_picture(eye_m[k], tracked, {}, kLens, 0.9, false), nearly = fits_picture(eye_m[k], tracked, {}, kLens, 1.1, false);
      EXPECT_TRUE(!fits || share[k] < 0.06) << targets << " targets, place " << k << ": " << share[k];
      EXPECT_TRUE(nearly || share[k] > 0) << targets << " targets, place " << k;
      fitting += fits, tight += !nearly;
    }
  }
  EXPECT_GT(fitting, 200);
  EXPECT_GT(tight, 200);
}

TEST(PictureFit, OneTargetAlwaysFits) {
  const std::vector<glm::dvec3> eye_m{{0, 0, 0}, {0, 5, 0.1}, {1, 1, 1}};
  for (const float share : shares(eye_m, {{1, 1, 1}}, {1})) EXPECT_EQ(share, 0);
  for (const float share : shares(eye_m, {{1, 1, 1}, {-40, 0, 0}}, {1, 0})) EXPECT_EQ(share, 0) << "the other one does not count";
}

TEST(PictureFit, ACameraBetweenItsTargetsShowsTheHeaviest) {
  const std::vector<glm::dvec3> between{{0, 0, 0.1}}, before{{0, 0, 20}};
  EXPECT_FLOAT_EQ(shares(between, {{-3, 0, 0}, {3, 0, 0}}, {1, 1})[0], 0.5f);
  EXPECT_FLOAT_EQ(shares(between, {{-3, 0, 0}, {3, 0, 0}}, {3, 1})[0], 0.25f);
  for (const glm::dvec3& side : {glm::dvec3(3, 0, 0), glm::dvec3(0, 0, 3), glm::dvec3(0, 3, 0)})
    EXPECT_FLOAT_EQ(shares({{0, 0, 0}}, {-side, side}, {1, 1})[0], 0.5f) << "on the line through both";
  EXPECT_EQ(shares(before, {{-3, 0, 0}, {3, 0, 0}}, {1, 1})[0], 0);
}

TEST(PictureFit, APlaceOnATargetHasAShare) {
  const std::vector<glm::dvec3> on{{-3, 0, 0}, {0, 0, 0}};
  for (const float share : shares(on, {{-3, 0, 0}, {3, 0, 0}}, {1, 1})) {
    EXPECT_GE(share, 0.0f);
    EXPECT_LE(share, 0.5f);
  }
}

TEST(PictureFit, TargetsComeApartByTheWidestGapBetweenGroups) {
  const std::vector<double> alike(4, 1.0);
  const std::vector<glm::dvec3> in_a_row{{0, 0, 0}, {2, 0, 0}, {4, 0, 0}, {6, 0, 0}};
  EXPECT_EQ(apart(in_a_row, alike, 1.0), 0) << "long, but without a gap";
  const std::vector<glm::dvec3> in_two{{0, 0, 0}, {6.5, 0, 0}, {2, 0, 0}, {8, 0, 0}};
  EXPECT_DOUBLE_EQ(apart(in_two, alike, 1.0), 0.5) << "4.5 m between 2 and 6.5";
  EXPECT_DOUBLE_EQ(apart(in_two, alike, 0.5), 1.0);
  EXPECT_EQ(apart(in_two, std::vector{1.0, 0.0, 1.0, 0.0}, 1.0), 0) << "those that count are together";
  EXPECT_EQ(apart(in_two, std::vector(4, 0.0), 1.0), 0);
}

}  // namespace
}  // namespace sightline
