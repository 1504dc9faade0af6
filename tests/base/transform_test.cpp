#include "server/base/transform.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "server/base/camera.h"
#include "server/base/random.h"

namespace sightline {
namespace {

constexpr double kPi = std::numbers::pi;

class Draw {
 public:
  explicit Draw(uint64_t seed) : random_(seed, 0, RandomPurpose::kTest) {}
  double in(double low, double high) { return random_.next_in(low, high); }
  glm::dvec3 vec(double size) { return {in(-size, size), in(-size, size), in(-size, size)}; }
  glm::dquat rotation() { return glm::normalize(glm::dquat(in(-1, 1), in(-1, 1), in(-1, 1), in(-1, 1))); }
  Affine affine() { return make_affine(vec(10), rotation(), vec(3) + glm::dvec3(4)); }

 private:
  CounterRandom random_;
};

void expect_near(const glm::dvec3& a, const glm::dvec3& b, double tolerance = 1e-9) {
  EXPECT_LT(glm::distance(a, b), tolerance)
      << a.x << ' ' << a.y << ' ' << a.z << " / " << b.x << ' ' << b.y << ' ' << b.z;
}

TEST(Affine, ScaleComesBeforeRotationBeforeTranslation) {
  const glm::dquat quarter_turn_about_y(std::cos(kPi / 4), 0, std::sin(kPi / 4), 0);
  const Affine a = make_affine({1, 2, 3}, quarter_turn_about_y, {2, 1, 1});
  expect_near(transform_point(a, {1, 0, 0}), {1, 2, 1});  // x -> 2x -> -2z -> translated
  expect_near(transform_vector(a, {1, 0, 0}), {0, 0, -2});
}

TEST(Affine, InverseUndoesAndComposeChains) {
  Draw draw(1);
  for (int i = 0; i < 200; ++i) {
    const Affine a = draw.affine(), b = draw.affine(), sheared = compose(a, b);
    const glm::dvec3 p = draw.vec(10);
    expect_near(transform_point(inverse(sheared), transform_point(sheared, p)), p, 1e-8);
    expect_near(transform_point(sheared, p), transform_point(a, transform_point(b, p)));
  }
}

TEST(Affine, MaxStretchIsExactForScaledRotationsAndNeverTooSmall) {
  Draw draw(2);
  for (int i = 0; i < 100; ++i) {
    const glm::dvec3 scale = draw.vec(3);
    EXPECT_NEAR(max_stretch(make_affine(draw.vec(10), draw.rotation(), scale)),
                std::max({std::abs(scale.x), std::abs(scale.y), std::abs(scale.z)}), 1e-7);
    const Affine sheared = compose(draw.affine(), draw.affine());
    for (int k = 0; k < 100; ++k) {
      const glm::dvec3 v = glm::normalize(draw.vec(1));
      EXPECT_LE(glm::length(transform_vector(sheared, v)), max_stretch(sheared) * (1 + 1e-12));
    }
  }
}

TEST(Pose, InverseTransformUndoesTransform) {
  Draw draw(3);
  const Pose pose{draw.vec(10), draw.rotation()};
  const glm::dvec3 p = draw.vec(10);
  expect_near(inverse_transform_point(pose, transform_point(pose, p)), p);
}

TEST(LookRotation, PointsMinusZForwardAndDoesNotRoll) {
  Draw draw(4);
  for (int i = 0; i < 500; ++i) {
    const glm::dvec3 forward = glm::normalize(draw.vec(1));
    const glm::dquat q = look_rotation(forward, {0, 1, 0}, {1, 0, 0});
    EXPECT_NEAR(glm::length(q), 1.0, 1e-12);
    expect_near(q * glm::dvec3(0, 0, -1), forward);
    if (std::abs(forward.y) > 0.999) continue;
    EXPECT_NEAR((q * glm::dvec3(1, 0, 0)).y, 0.0, 1e-9);  // right is level
    EXPECT_GT((q * glm::dvec3(0, 1, 0)).y, 0.0);          // up is up
  }
}

TEST(LookRotation, StraightUpAndDownKeepTheRightHandSide) {
  Draw draw(5);
  for (const double up : {1.0, -1.0})
    for (int i = 0; i < 50; ++i) {
      const double heading = draw.in(0, 2 * kPi);
      const glm::dvec3 right(std::cos(heading), 0, std::sin(heading));
      const glm::dquat q = look_rotation({0, up, 0}, {0, 1, 0}, right);
      expect_near(q * glm::dvec3(0, 0, -1), {0, up, 0});
      expect_near(q * glm::dvec3(1, 0, 0), right);
    }
}

TEST(LookRotation, IsContinuousOnTheWayToStraightDown) {
  const glm::dvec3 right(1, 0, 0);
  glm::dquat previous = look_rotation({0, 0, -1}, {0, 1, 0}, right);
  for (int i = 1; i <= 1000; ++i) {
    const double pitch = kPi / 2 * i / 1000;
    const glm::dquat q = look_rotation({0, -std::sin(pitch), -std::cos(pitch)}, {0, 1, 0}, right);
    EXPECT_LT(angle_between(previous, q), 0.01) << pitch;
    previous = q;
  }
}

TEST(LookRotation, IsDefinedEvenWhenTheRightHintIsParallelToo) {
  for (const glm::dvec3& axis : {glm::dvec3(0, 1, 0), glm::dvec3(1, 0, 0), glm::dvec3(0, 0, 1)}) {
    const glm::dquat q = look_rotation(axis, axis, axis);
    ASSERT_TRUE(is_finite(q));
    expect_near(q * glm::dvec3(0, 0, -1), axis);
  }
}

TEST(AngleBetween, IsTheSmallestAngleAndIgnoresTheSignOfTheQuaternion) {
  const auto about_y = [](double angle) { return glm::dquat(std::cos(angle / 2), 0, std::sin(angle / 2), 0); };
  EXPECT_NEAR(angle_between(about_y(0.3), about_y(1.0)), 0.7, 1e-12);
  EXPECT_NEAR(angle_between(about_y(0), about_y(1.5 * kPi)), 0.5 * kPi, 1e-12);
  EXPECT_NEAR(angle_between(about_y(0.4), -about_y(0.4)), 0.0, 1e-12);
  EXPECT_NEAR(angle_between(about_y(0), about_y(1e-9)), 1e-9, 1e-15);
}

TEST(IsFinite, SeesEveryComponent) {
  for (const double bad : {NAN, INFINITY, -INFINITY}) {
    for (int i = 0; i < 3; ++i) {
      glm::dvec3 v(0);
      v[i] = bad;
      EXPECT_FALSE(is_finite(v));
    }
    for (int i = 0; i < 4; ++i) {
      glm::dquat q(1, 0, 0, 0);
      q[i] = bad;
      EXPECT_FALSE(is_finite(q));
    }
  }
  EXPECT_TRUE(is_finite(glm::dvec3(1e300)));
}

TEST(Lens, HorizontalFieldOfViewAndNearCorner) {
  const Lens lens{kPi / 2, 2.0, 0.5};
  EXPECT_NEAR(half_horizontal_fov_rad(lens), std::atan(2.0), 1e-12);
  EXPECT_NEAR(near_corner_distance_m(lens), glm::length(glm::dvec3(1.0, 0.5, 0.5)), 1e-12);
}

}  // namespace
}  // namespace sightline
