#include "scenes/forest.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "server/sample/embree_scene.h"
#include "tests/scenes/hidden.h"
#include "tests/scenes/stage.h"

namespace sightline {
namespace {

using namespace sightline::scenes;

class Forest : public testing::TestWithParam<uint64_t> {};
INSTANTIATE_TEST_SUITE_P(Seeds, Forest, testing::Values(1, 2, 77));

TEST_P(Forest, HidesATargetFromACameraAtAFixedOffsetInOver15PercentOfFrames) {
  const auto bytes = make_forest({.seed = GetParam()});
  for (bool turning : {false, true}) {
    const Hidden hidden = hidden_from_fixed_offset(bytes, turning);
    RecordProperty(turning ? "turning_any_percent" : "any_percent", static_cast<int>(100 * hidden.one_or_more));
    RecordProperty(turning ? "turning_all_percent" : "all_percent", static_cast<int>(100 * hidden.all));
    EXPECT_GT(hidden.one_or_more, 0.15) << (turning ? "turning" : "not turning");
  }
}

TEST_P(Forest, PathWindsToBothSides) {
  const Stage stage(make_forest({.seed = GetParam()}));
  for (const Role& role : stage.with_role("target")) {
    double low = 0, high = 0;
    for (double time_s = 0; time_s < 30; time_s += 0.1) {
      const glm::dvec3 step = stage.pose_of(role, time_s + 0.1).position_m - stage.pose_of(role, time_s).position_m;
      low = std::min(low, std::atan2(step.z, step.x));
      high = std::max(high, std::atan2(step.z, step.x));
    }
    EXPECT_LT(low, -0.4) << role.name;
    EXPECT_GT(high, 0.4) << role.name;
  }
}

// Casts rays outwards from a target's path, at the height of a chest and of a high camera.
TEST_P(Forest, TrunksCollideAndCrownsDoNot) {
  Stage stage(make_forest({.seed = GetParam()}));
  stage.play(0);
  EmbreeDevice device;
  EmbreeScene colliders(device, EmbreeScene::Content::kColliders), occluders(device, EmbreeScene::Content::kOccluders);
  colliders.take_in(stage.mirror());
  occluders.take_in(stage.mirror());
  const std::vector<uint32_t> targets = stage.target_slots();
  const Role role = stage.with_role("target")[0];
  int trunks = 0, crowns = 0, rays = 0;
  for (double time_s = 0; time_s < 30; time_s += 0.25)
    for (int turn = 0; turn < 8; ++turn, ++rays) {
      const double angle = turn * 0.7854;
      const glm::vec3 out(std::cos(angle), 0, std::sin(angle));
      const auto is_hit = [&](const EmbreeScene& scene, double height_m) {
        const glm::dvec3 from = stage.pose_of(role, time_s).position_m + glm::dvec3(0, height_m, 0);
        return scene.trace(from, out, 0, 8, {.ignored_slots = targets}).slot != UINT32_MAX;
      };
      trunks += is_hit(colliders, 1.2);
      crowns += is_hit(occluders, 4.0) && !is_hit(colliders, 4.0);
    }
  EXPECT_GT(trunks, rays / 10);
  EXPECT_GT(crowns, rays / 5);
}

TEST_P(Forest, TrunksComeBetweenTheTargets) {
  Stage stage(make_forest({.seed = GetParam()}));
  stage.play(0);
  EmbreeDevice device;
  EmbreeScene colliders(device, EmbreeScene::Content::kColliders);
  colliders.take_in(stage.mirror());
  const std::vector<Role> roles = stage.with_role("target");
  int between = 0;
  for (double time_s = 0; time_s < 30; time_s += 0.05) {
    const glm::dvec3 a = stage.pose_of(roles[0], time_s).position_m, b = stage.pose_of(roles[1], time_s).position_m;
    between += colliders
                   .trace(a + glm::dvec3(0, 0.9, 0), glm::vec3(b - a), 0, 1, {.ignored_slots = stage.target_slots()})
                   .slot != UINT32_MAX;
  }
  EXPECT_GT(between, 0);
}

}  // namespace
}  // namespace sightline
