#include "scenes/corridors.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "server/sample/embree_scene.h"
#include "tests/scenes/hidden.h"
#include "tests/scenes/stage.h"

namespace sightline {
namespace {

using namespace sightline::scenes;

class Corridors : public testing::TestWithParam<uint64_t> {};
INSTANTIATE_TEST_SUITE_P(Seeds, Corridors, testing::Values(1, 2, 77));

// The axis of the grid that they walk along, 0 to 3.
int axis_of(const Stage& stage, const Role& role, double time_s) {
  const glm::dvec3 front = stage.pose_of(role, time_s).rotation * glm::dvec3(0, 0, 1);
  return std::abs(front.x) > std::abs(front.z) ? (front.x > 0 ? 0 : 2) : (front.z > 0 ? 1 : 3);
}

TEST_P(Corridors, TargetsTurnThroughARightAngleAtLeastEightTimes) {
  const Stage stage(make_corridors({.seed = GetParam()}));
  const Role target = stage.with_role("target")[0];
  int turns = 0;
  for (double time_s = 0.1; time_s < 30; time_s += 0.1)
    turns += axis_of(stage, target, time_s - 0.1) != axis_of(stage, target, time_s);
  EXPECT_GE(turns, 8);
}

TEST_P(Corridors, SecondTargetWalksWhereTheFirstHasBeen) {
  const Stage stage(make_corridors({.seed = GetParam()}));
  const std::vector<Role> targets = stage.with_role("target");
  for (double time_s = 0.75; time_s < 30; time_s += 0.25)
    EXPECT_LT(glm::distance(stage.pose_of(targets[1], time_s).position_m,
                            stage.pose_of(targets[0], time_s - 0.75).position_m),
              1e-3)
        << "at " << time_s;
}

// Casts rays all around and one upwards, from the height of a chest on the path.
TEST_P(Corridors, AreClosedAndNarrow) {
  Stage stage(make_corridors({.seed = GetParam()}));
  stage.play(0);
  EmbreeDevice device;
  EmbreeScene colliders(device, EmbreeScene::Content::kColliders);
  colliders.take_in(stage.mirror());
  const Role target = stage.with_role("target")[0];
  int places = 0, narrow = 0;  // a wall to the left and to the right within 1.2 m: not so at a crossing
  for (double time_s = 0; time_s <= 30; time_s += 0.1, ++places) {
    const glm::dvec3 chest = stage.pose_of(target, time_s).position_m + glm::dvec3(0, 1.1, 0);
    const auto meets = [&](const glm::vec3& d, float within_m) {
      return colliders.trace(chest, d, 0, within_m, {.ignored_slots = stage.target_slots()}).slot != UINT32_MAX;
    };
    EXPECT_TRUE(meets({0, 1, 0}, 2)) << "at " << time_s;
    for (int turn = 0; turn < 16; ++turn)
      EXPECT_TRUE(meets({std::cos(turn * 0.3927f + 0.05f), 0, std::sin(turn * 0.3927f + 0.05f)}, 60))
          << "at " << time_s << ", " << turn;
    narrow += (meets({1, 0, 0}, 1.2f) && meets({-1, 0, 0}, 1.2f)) ||
              (meets({0, 0, 1}, 1.2f) && meets({0, 0, -1}, 1.2f));
  }
  EXPECT_GE(narrow, places / 2);
}

TEST_P(Corridors, HideTheTargetsFromWhoIsNotInTheSamePassage) {
  const auto bytes = make_corridors({.seed = GetParam()});
  const Hidden hidden = hidden_from_fixed_offset(bytes, true);
  RecordProperty("any_percent", static_cast<int>(100 * hidden.one_or_more));
  RecordProperty("all_percent", static_cast<int>(100 * hidden.all));
  EXPECT_GT(hidden.all, 0.15);
}

TEST_P(Corridors, SidePassagesComeAndGoWithTheOption) {
  const auto walls = [&](double blind_share) {
    return Stage(make_corridors({.seed = GetParam(), .blind_share = blind_share})).asset().nodes.size();
  };
  EXPECT_LT(walls(0), walls(0.35));
  EXPECT_LT(walls(0.35), walls(1));
}

}  // namespace
}  // namespace sightline
