#include "scenes/doors.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/sample/embree_scene.h"
#include "tests/scenes/stage.h"

namespace sightline {
namespace {

using namespace sightline::scenes;

class Doors : public testing::TestWithParam<uint64_t> {};
INSTANTIATE_TEST_SUITE_P(Seeds, Doors, testing::Values(1, 2, 77));

glm::ivec2 room_at(const glm::dvec3& p) {
  return {static_cast<int>(p.x / 6), static_cast<int>(p.z / 6)};
}

// Counts how often a follower runs into a wall or door that it was clear of before. The follower has a radius of 0.25
// m, and is always where the second target was `behind_s` ago.
int times_cut_off(const std::vector<std::byte>& bytes, double behind_s) {
  Stage stage(bytes);
  EmbreeDevice device;
  EmbreeScene colliders(device, EmbreeScene::Content::kColliders);
  const Role leader = stage.with_role("target")[1];
  int times = 0;
  bool was_clear = true;
  for (double time_s = behind_s; time_s <= stage.duration_s(); time_s += 1.0 / 30.0) {
    stage.play(time_s);
    colliders.take_in(stage.mirror());
    const glm::dvec3 chest = stage.pose_of(leader, time_s - behind_s).position_m + glm::dvec3(0, 1.1, 0);
    const bool is_clear = colliders.nearest_surface_m(chest, 1.0f, stage.target_slots()) >= 0.25;
    times += was_clear && !is_clear;
    was_clear = is_clear;
  }
  return times;
}

TEST_P(Doors, LetACloseFollowerPassAndCutOffADistantOne) {
  const auto bytes = make_doors({.seed = GetParam()});
  EXPECT_EQ(times_cut_off(bytes, 0.7), 0);
  EXPECT_GE(times_cut_off(bytes, 2.0), 4);
}

TEST_P(Doors, StayOpenLongerWhenSet) {
  const auto bytes = make_doors({.seed = GetParam(), .hold_s = 3});
  EXPECT_EQ(times_cut_off(bytes, 2.0), 0);
  EXPECT_GE(times_cut_off(bytes, 4.5), 1);
}

// The door between the room that the targets have just left and their present room is shut 2 s after the second target
// passed it, unless a target returns.
TEST_P(Doors, CloseBehindBothTargets) {
  Stage stage(make_doors({.seed = GetParam()}));
  EmbreeDevice device;
  EmbreeScene colliders(device, EmbreeScene::Content::kColliders);
  const Role second = stage.with_role("target")[1];
  int passed = 0, shut = 0;
  for (double time_s = 0; time_s + 2.1 < 30; time_s += 1.0 / 60.0) {
    const glm::dvec3 before = stage.pose_of(second, time_s).position_m;
    const glm::dvec3 after = stage.pose_of(second, time_s + 1.0 / 60.0).position_m;
    if (room_at(before) == room_at(after)) continue;
    ++passed;
    stage.play(time_s + 2.0);
    colliders.take_in(stage.mirror());
    const glm::dvec3 forward = glm::normalize(after - before);
    shut += colliders
                .trace(before - forward + glm::dvec3(0, 1.1, 0), glm::vec3(forward), 0, 2,
                       {.ignored_slots = stage.target_slots()})
                .slot != UINT32_MAX;
  }
  EXPECT_GE(passed, 6);
  EXPECT_GE(shut, passed - 1);
}

TEST_P(Doors, RoofClosesTheRoomsAbove) {
  for (bool roofed : {false, true}) {
    Stage stage(make_doors({.seed = GetParam(), .roofed = roofed}));
    stage.play(0);
    EmbreeDevice device;
    EmbreeScene colliders(device, EmbreeScene::Content::kColliders);
    colliders.take_in(stage.mirror());
    const glm::dvec3 camera = stage.pose_of(stage.with_role("camera")[0], 0).position_m;
    EXPECT_EQ(colliders.trace(camera, {0, 1, 0}, 0, 10, {}).slot != UINT32_MAX, roofed);
  }
}

}  // namespace
}  // namespace sightline
