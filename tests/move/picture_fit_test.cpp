#include "server/move/picture_fit.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "server/base/transform.h"

namespace sightline {
namespace {

constexpr Lens kLens{.vertical_fov_rad = 0.7, .aspect = 16.0 / 9.0};

std::vector<float> shares(const std::vector<glm::dvec3>& eye_m, const std::vector<Body>& bodies) {
  PictureFit fit;
  fit.set_places(eye_m);
  std::vector<float> share(eye_m.size(), -1.0f);
  fit.outside_share(bodies, kLens, 0.0, share);
  return share;
}
Body standing(const glm::dvec3& middle_m, double height_m = 1.8, double aside_m = 0.3, double weight = 1) {
  return {middle_m - glm::dvec3(0, height_m / 2, 0), middle_m + glm::dvec3(0, height_m / 2, 0), aside_m, weight};
}

struct Rectangle {
  glm::dvec2 low{1e9}, high{-1e9};
  void include(const glm::dvec2& at) { low = glm::min(low, at), high = glm::max(high, at); }
};

// The rectangle around a body, found by drawing points all over the cylinder that encloses it.
Rectangle drawn(const Pose& world_from_camera, const Body& body) {
  Rectangle around;
  for (int up = 0; up <= 20; ++up)
    for (int turn = 0; turn < 64; ++turn) {
      const double angle = turn * std::numbers::pi / 32;
      const glm::dvec3 out_m(body.aside_m * std::cos(angle), 0, body.aside_m * std::sin(angle));
      const glm::dvec3 p = inverse_transform_point(world_from_camera,
                                                   glm::mix(body.low_m, body.high_m, up / 20.0) + out_m);
      around.include(glm::dvec2(p.x, p.y) / std::max(-p.z, 1e-3));
    }
  return around;
}

double inside(double low, double high, double edge) {
  return std::max(0.0, std::min(high, edge) - std::max(low, -edge)) / (high - low);
}

// The camera looks at the middle of all that is drawn, by an aim that is improved step by step.
double drawn_share(const glm::dvec3& eye_m, const std::vector<Body>& bodies) {
  glm::dvec3 forward(0.0);
  double all = 0, out = 0;
  for (const Body& body : bodies)
    if (body.weight > 0) forward += glm::normalize((body.low_m + body.high_m) / 2.0 - eye_m), all += body.weight;
  Pose pose{eye_m, look_rotation(forward, {0, 1, 0}, {1, 0, 0})};
  for (int k = 0; k < 3; ++k) {
    Rectangle group;
    for (const Body& body : bodies)
      if (body.weight > 0) group.include(drawn(pose, body).low), group.include(drawn(pose, body).high);
    pose.rotation = look_rotation(pose.rotation * glm::dvec3((group.low + group.high) / 2.0, -1), {0, 1, 0}, {1, 0, 0});
  }
  const double top = std::tan(kLens.vertical_fov_rad / 2);
  for (const Body& body : bodies) {
    if (!(body.weight > 0)) continue;
    const Rectangle at = drawn(pose, body);
    out += body.weight * (1 - inside(at.low.x, at.high.x, top * kLens.aspect) * inside(at.low.y, at.high.y, top));
  }
  return out / all;
}

TEST(PictureFit, SharesAreThoseOfADrawing) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> far_m(-6.0, 6.0), near_m(-1.5, 1.5), weight(0.1, 2.0);
  int partial = 0, none = 0;
  double worst = 0, sum = 0;
  for (size_t targets = 1; targets <= 4; ++targets) {
    std::vector<glm::dvec3> eye_m;
    std::vector<Body> bodies;
    for (size_t k = 0; k < targets; ++k)
      bodies.push_back(
          standing({300 + near_m(random), 0.9 + near_m(random) / 8, near_m(random)}, 1.8, 0.3, weight(random)));
    while (eye_m.size() < 400) {
      const glm::dvec3 at_m(300 + far_m(random), 0.2 + std::abs(far_m(random)) / 2, far_m(random));
      const bool is_near = std::ranges::any_of(
          bodies, [&](const Body& body) { return glm::distance(at_m, (body.low_m + body.high_m) / 2.0) < 1.3; });
      // Between its targets, the middle of what a camera would have to show says little.
      const bool is_between = std::hypot(at_m.x - 300, at_m.z) < 3.0 && targets > 1;
      if (!is_near && !is_between) eye_m.push_back(at_m);
    }
    const std::vector<float> share = shares(eye_m, bodies);
    for (size_t k = 0; k < eye_m.size(); ++k) {
      const double expected = drawn_share(eye_m[k], bodies), error = std::abs(share[k] - expected);
      worst = std::max(worst, error), sum += error;
      partial += expected > 0.02 && expected < 0.9, none += expected < 1e-3;
    }
  }
  EXPECT_LT(worst, 0.2);
  EXPECT_LT(sum / 1600, 0.01);
  EXPECT_GT(partial, 100);
  EXPECT_GT(none, 200);
}

TEST(PictureFit, APlaceRightBeforeATargetShowsAPartOfIt) {
  const std::vector<Body> one{standing({0, 0.9, 0})};
  const double top = std::tan(kLens.vertical_fov_rad / 2);
  const auto from = [&](double distance_m) { return shares({{0, 0.9, distance_m}}, one)[0]; };
  EXPECT_EQ(from(0.91 / top), 0);
  EXPECT_NEAR(from(0.5 * 0.9 / top), 0.5, 1e-3) << "the picture holds half of its height";
  EXPECT_GT(from(0.4), 0.8);
}

TEST(PictureFit, ACameraBetweenItsTargetsShowsNeitherWhole) {
  EXPECT_GT(shares({{0, 0.9, 0.1}}, {standing({-3, 0.9, 0}), standing({3, 0.9, 0})})[0], 0.4);
  EXPECT_EQ(shares({{0, 0.9, 20}}, {standing({-3, 0.9, 0}), standing({3, 0.9, 0})})[0], 0);
  EXPECT_EQ(shares({{0, 0.9, 4}}, {standing({0, 0.9, 0}), standing({0, 0.9, 8}, 1.8, 0.3, 0)})[0], 0)
      << "the other one does not count";
}

TEST(PictureFit, SharesAreNumbersEverywhere) {
  std::vector<glm::dvec3> eye_m{{-3, 0.9, 0}, {0, 0.9, 0}, {3, 0.9, 0}, {-3, 5, 0}};
  const std::vector<Body> two{standing({-3, 0.9, 0}), standing({3, 0.9, 0})}, point{standing({-3, 0.9, 0}, 0, 0)};
  for (const std::vector<Body>& bodies : {two, point, {standing({3, 0.9, 0}, 1.8, 0.3, 0)}})
    for (const float share : shares(eye_m, bodies)) EXPECT_TRUE(share >= 0 && share <= 1) << share;
}

}  // namespace
}  // namespace sightline
