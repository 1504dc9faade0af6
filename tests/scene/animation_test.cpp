// Keyframes by value, against the formulas of glTF 2.0 section 3.11 and appendix C written out by hand.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "server/scene/gltf.h"
#include "tests/support/glb_builder.h"

namespace sightline {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

const float kHalf = std::sqrt(0.5f);

class Animation : public testing::Test {
 protected:
  Result<std::shared_ptr<const SceneAsset>> read() { return read_gltf(file.glb(), nullptr, store); }
  const SceneAsset& load() {
    auto result = read();
    if (!result) ADD_FAILURE() << to_string(result.error());
    asset = result ? *result : std::make_shared<SceneAsset>();
    return *asset;
  }
  Affine world_at(double time_s, size_t node = 0) {
    return animated_world_from_node(*asset, asset->animations.at(0), time_s).at(node);
  }
  void expect_near(const glm::dvec3& value, const glm::dvec3& wanted) {
    EXPECT_NEAR(glm::length(value - wanted), 0.0, 1e-6) << value.x << " " << value.y << " " << value.z;
  }

  GlbBuilder file;
  GeometryStore store;
  std::shared_ptr<const SceneAsset> asset;
};

TEST_F(Animation, LinearTranslationIsMixedAndClampedAtBothEnds) {
  file.animation(file.add("nodes", {{"scale", {2, 2, 2}}}), "translation", "LINEAR", {1, 3}, {0, 0, 0, 4, 0, 8});
  load();
  EXPECT_EQ(asset->animations[0].duration_s, 3.0);
  expect_near(world_at(0.0)[3], {0, 0, 0});
  expect_near(world_at(1.5)[3], {1, 0, 2});
  expect_near(world_at(99.0)[3], {4, 0, 8});
  expect_near(world_at(1.5)[0], {2, 0, 0});  // what is not animated keeps its value
}

TEST_F(Animation, StepHoldsTheKeyUntilTheNext) {
  file.animation(file.add("nodes", {{"name", "n"}}), "translation", "STEP", {0, 1, 2}, {1, 0, 0, 2, 0, 0, 3, 0, 0});
  load();
  expect_near(world_at(0.999)[3], {1, 0, 0});
  expect_near(world_at(1.0)[3], {2, 0, 0});
  expect_near(world_at(2.0)[3], {3, 0, 0});
}

TEST_F(Animation, RotationTurnsAtConstantSpeed) {
  // A quarter turn about Z in one second: after a third of it, 30 degrees.
  file.animation(file.add("nodes", {{"name", "n"}}), "rotation", "LINEAR", {0, 1}, {0, 0, 0, 1, 0, 0, kHalf, kHalf});
  load();
  const double angle = std::acos(-1.0) / 6.0;
  expect_near(world_at(1.0 / 3.0)[0], {std::cos(angle), std::sin(angle), 0});
}

TEST_F(Animation, RotationTakesTheShortWayRound) {
  file.animation(file.add("nodes", {{"name", "n"}}), "rotation", "LINEAR", {0, 1}, {0, 0, 0, 1, 0, 0, -kHalf, -kHalf});
  load();
  expect_near(world_at(0.5)[0], {std::cos(std::acos(-1.0) / 4), std::sin(std::acos(-1.0) / 4), 0});
}

TEST_F(Animation, CubicTangentsAreScaledByTheInterval) {
  // Values 0 -> 6 over 2 s with slope 3 at both ends is the straight line x = 3 t only when tangents are
  // scaled.
  file.animation(file.add("nodes", {{"name", "n"}}), "translation", "CUBICSPLINE", {1, 3},
                 {9, 9, 9, 0, 0, 0, 3, 0, 0, 3, 0, 0, 6, 0, 0, 9, 9, 9});
  load();
  for (const double t : {0.0, 0.25, 0.5, 1.0, 1.75, 2.0}) expect_near(world_at(1.0 + t)[3], {3 * t, 0, 0});
}

TEST_F(Animation, CubicSplinesFollowTheHermiteFormula) {
  file.animation(file.add("nodes", {{"name", "n"}}), "scale", "CUBICSPLINE", {0, 4},
                 {0, 0, 0, 1, 1, 1, 2, 0, -1, -3, 5, 0, 7, 8, 9, 0, 0, 0});
  load();
  const double s = 0.3, s2 = s * s, s3 = s2 * s, d = 4.0;
  const auto hermite = [&](double v0, double b0, double v1, double a1) {
    return (2 * s3 - 3 * s2 + 1) * v0 + d * (s3 - 2 * s2 + s) * b0 + (-2 * s3 + 3 * s2) * v1 + d * (s3 - s2) * a1;
  };
  const Affine world = world_at(s * d);
  expect_near({world[0].x, world[1].y, world[2].z}, {hermite(1, 2, 7, -3), hermite(1, 0, 8, 5), hermite(1, -1, 9, 0)});
}

TEST_F(Animation, CubicRotationsAreNormalized) {
  file.animation(file.add("nodes", {{"name", "n"}}), "rotation", "CUBICSPLINE", {0, 1},
                 {0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, kHalf, kHalf, 0, 0, 0, 0});
  load();
  const Affine world = world_at(0.5);
  for (int axis = 0; axis < 3; ++axis) EXPECT_NEAR(glm::length(world[axis]), 1.0, 1e-12);
  EXPECT_NEAR(std::atan2(world[0].y, world[0].x), std::acos(-1.0) / 4, 1e-6);
}

TEST_F(Animation, NormalizedShortRotationsAreRead) {
  const int node = file.add("nodes", {{"name", "n"}});
  file.animation(node, "rotation", "LINEAR", {0, 1}, {0, 0, 0, 1, 0, 0, 0, 1});
  const int output = file.accessor<int16_t>({0, 0, 0, 32767, 0, 0, 32767, 0}, "VEC4", kShort, true);
  file.json["animations"][0]["samplers"][0]["output"] = output;
  load();
  expect_near(world_at(1.0)[0], {-1, 0, 0});
}

TEST_F(Animation, ChildrenMoveWithTheirParent) {
  const int child = file.add("nodes", {{"translation", {0, 1, 0}}});
  const int parent = file.add("nodes", {{"children", {child}}});
  file.animation(parent, "translation", "LINEAR", {0, 1}, {0, 0, 0, 10, 0, 0});
  load();
  expect_near(world_at(0.5, 1)[3], {5, 1, 0});
}

TEST_F(Animation, ADecomposedMatrixCanBeAnimated) {
  file.animation(file.add("nodes", {{"matrix", {2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 1, 2, 3, 1}}}), "translation",
                 "LINEAR", {0, 1}, {0, 0, 0, 8, 0, 0});
  load();
  expect_near(world_at(1.0)[3], {8, 0, 0});
  expect_near(world_at(1.0)[1], {0, 2, 0});
}

TEST_F(Animation, AShearedNodeStaysWhereItIsWithAWarning) {
  file.animation(file.add("nodes", {{"matrix", {1, 0, 0, 0, 1, 1, 0, 0, 0, 0, 1, 0, 1, 2, 3, 1}}}), "translation",
                 "LINEAR", {0, 1}, {0, 0, 0, 8, 0, 0});
  load();
  EXPECT_TRUE(asset->animations.at(0).channels.empty());
  expect_near(world_at(1.0)[3], {1, 2, 3});
  EXPECT_THAT(asset->warnings, testing::Contains(HasSubstr("animations[0].channels[0]: ignored")));
}

TEST_F(Animation, WeightsAndNodesOutsideTheSceneAreIgnoredWithAWarning) {
  const int shown = file.add("nodes", {{"name", "shown"}});
  const int hidden = file.add("nodes", {{"name", "hidden"}});
  file.add("scenes", {{"nodes", {shown}}});
  file.animation(hidden, "translation", "LINEAR", {0, 1}, {0, 0, 0, 1, 0, 0});
  file.animation(shown, "weights", "LINEAR", {0, 1}, {0, 0, 0, 1, 0, 0});
  load();
  EXPECT_THAT(asset->warnings, ElementsAre(HasSubstr("not part of the scene"), HasSubstr("morph targets")));
}

TEST_F(Animation, AChannelWithoutANodeIsIgnored) {
  file.animation(file.add("nodes", {{"name", "n"}}), "translation", "LINEAR", {0, 1}, {0, 0, 0, 1, 0, 0});
  file.json["animations"][0]["channels"][0]["target"].erase("node");
  EXPECT_TRUE(load().animations.at(0).channels.empty());
}

TEST_F(Animation, OneKeyHoldsForEver) {
  file.animation(file.add("nodes", {{"name", "n"}}), "translation", "LINEAR", {2}, {7, 0, 0});
  load();
  for (const double t : {-1.0, 0.0, 2.0, 3.0}) expect_near(world_at(t)[3], {7, 0, 0});
}

TEST_F(Animation, WrongKeysAreNamed) {
  struct Case {
    std::vector<float> times, values;
    const char* interpolation;
    const char* field;
  };
  const float nan = std::nanf("");
  const std::vector<Case> cases = {
      {{0, 0}, {0, 0, 0, 1, 0, 0}, "LINEAR", "animations[0].samplers[0].input[1]"},
      {{1, 0}, {0, 0, 0, 1, 0, 0}, "LINEAR", "animations[0].samplers[0].input[1]"},
      {{-1, 0}, {0, 0, 0, 1, 0, 0}, "LINEAR", "animations[0].samplers[0].input[0]"},
      {{0, nan}, {0, 0, 0, 1, 0, 0}, "LINEAR", "animations[0].samplers[0].input[1]"},
      {{0, 1}, {0, 0, 0, nan, 0, 0}, "LINEAR", "animations[0].samplers[0].output[3]"},
      {{0, 1}, {0, 0, 0}, "LINEAR", "animations[0].samplers[0].output"},
      {{0, 1}, {0, 0, 0, 1, 0, 0}, "CUBICSPLINE", "animations[0].samplers[0].output"},
      {{0, 1}, {0, 0, 0, 1, 0, 0}, "BEZIER", "animations[0].samplers[0].interpolation"},
  };
  for (const Case& c : cases) {
    file = GlbBuilder();
    file.animation(file.add("nodes", {{"name", "n"}}), "translation", c.interpolation, c.times, c.values);
    const auto result = read();
    ASSERT_FALSE(result) << c.field;
    EXPECT_EQ(result.error().field, c.field);
  }
}

// A rotation of no direction is named by the number of its quaternion. Tangents of a spline may be zero.
TEST_F(Animation, ARotationWithoutDirectionIsNamedByItsKey) {
  const auto field = [&](const char* interpolation, const std::vector<float>& values) {
    file = GlbBuilder();
    file.animation(file.add("nodes", {{"name", "n"}}), "rotation", interpolation, {0, 1}, values);
    const auto result = read();
    return result ? std::string() : result.error().field;
  };
  EXPECT_EQ(field("LINEAR", {0, 0, 0, 0, 0, 0, 0, 1}), "animations[0].samplers[0].output[0]");
  EXPECT_EQ(field("LINEAR", {0, 0, 0, 1, 0, 0, 0, 0}), "animations[0].samplers[0].output[1]");
  const std::vector<float> zero = {0, 0, 0, 0}, one = {0, 0, 0, 1};
  const auto spline = [&](const std::vector<float>& first, const std::vector<float>& second) {
    std::vector<float> values;
    for (const auto* part : {&zero, &first, &zero, &zero, &second, &zero})
      values.insert(values.end(), part->begin(), part->end());
    return values;
  };
  EXPECT_EQ(field("CUBICSPLINE", spline(one, one)), "");
  EXPECT_EQ(field("CUBICSPLINE", spline(zero, one)), "animations[0].samplers[0].output[1]");
  EXPECT_EQ(field("CUBICSPLINE", spline(one, zero)), "animations[0].samplers[0].output[4]");
}

TEST_F(Animation, TwoChannelsMayNotShareATarget) {
  file.animation(file.add("nodes", {{"name", "n"}}), "translation", "LINEAR", {0, 1}, {0, 0, 0, 1, 0, 0});
  auto& channels = file.json["animations"][0]["channels"];
  channels.push_back(nlohmann::json(channels[0]));
  const auto result = read();
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().field, "animations[0].channels[1].target");
}

}  // namespace
}  // namespace sightline
