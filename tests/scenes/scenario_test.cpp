// Every generated scenario of the group `study` keeps these promises. level_test.cpp and situation_test.cpp test the
// other groups. They are checked through the server's reader and mirror, and with Embree for distances and visibility.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <numeric>
#include <optional>

#include "scenes/arena.h"
#include "scenes/catalog.h"
#include "scenes/city.h"
#include "scenes/fence.h"
#include "scenes/hall.h"
#include "scenes/rooms.h"
#include "server/sample/embree_scene.h"
#include "tests/scenes/hidden.h"
#include "tests/scenes/stage.h"

namespace sightline {
namespace {

using namespace sightline::scenes;

constexpr double kTick_s = 1.0 / 60.0;

// One scenario of the catalogue and a seed.
struct Case {
  std::string name;
  uint64_t seed = 1;
  std::vector<std::byte> make() const { return *find_scene(name)->make({.seed = seed}); }
};

void PrintTo(const Case& c, std::ostream* out) {
  *out << c.name << " seed " << c.seed;
}

std::vector<Case> all_cases() {
  std::vector<Case> cases;
  for (const SceneGroup group : {SceneGroup::kStudy, SceneGroup::kPaper})
    for (const CatalogEntry* entry : scenes_of(group))
      for (uint64_t seed : {1, 2, 77}) cases.push_back({entry->name, seed});
  return cases;
}

std::string print_case(const testing::TestParamInfo<Case>& info) {
  std::string name = info.param.name + "_" + std::to_string(info.param.seed);
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
}

class EveryScenario : public testing::TestWithParam<Case> {};
INSTANTIATE_TEST_SUITE_P(Scenes, EveryScenario, testing::ValuesIn(all_cases()), print_case);

TEST_P(EveryScenario, IsTheSameBytesOnEveryRun) {
  EXPECT_EQ(GetParam().make(), GetParam().make());
}

TEST_P(EveryScenario, DiffersFromThatOfAnotherSeed) {
  Case other = GetParam();
  other.seed += 1000;
  EXPECT_NE(GetParam().make(), other.make());
}

TEST_P(EveryScenario, IsReadWithoutWarningAndHasOneAnimationAndOneCamera) {
  const Stage stage(GetParam().make());
  EXPECT_THAT(stage.asset().warnings, testing::IsEmpty());
  ASSERT_EQ(stage.asset().animations.size(), 1u);
  EXPECT_EQ(stage.animation().name, "scenario");
  ASSERT_EQ(stage.with_role("camera").size(), 1u);
  const AssetNode& camera = stage.asset().nodes[static_cast<size_t>(stage.with_role("camera")[0].node)];
  EXPECT_GE(camera.camera, 0);
  EXPECT_GE(stage.with_role("target").size(), 2u);
}

TEST_P(EveryScenario, MovesExactlyTheNodesThatHaveAMovingRole) {
  const Stage stage(GetParam().make());
  std::map<int, int> channels;  // by node
  for (const AssetChannel& channel : stage.animation().channels) {
    EXPECT_EQ(channel.interpolation, AssetChannel::Interpolation::kLinear);
    EXPECT_EQ(channel.times_s.front(), 0.0f);
    EXPECT_EQ(stage.asset().nodes[static_cast<size_t>(channel.node)].parent, -1);
    ++channels[channel.node];
  }
  std::map<int, int> expected;
  for (const Role& role : stage.roles())
    if (role.role != "camera") expected[role.node] = 2;  // translation and rotation
  EXPECT_EQ(channels, expected);
}

// Two keys one tick apart that differ by more than a walker can move would be a jump.
TEST_P(EveryScenario, MovesTargetsWithoutJumps) {
  const Stage stage(GetParam().make());
  for (const Role& role : stage.with_role("target")) {
    Pose before = stage.pose_of(role, 0);
    glm::dvec3 velocity_before{0.0};
    for (int tick = 1; tick * kTick_s < stage.duration_s() - 1e-6; ++tick) {
      const Pose now = stage.pose_of(role, tick * kTick_s);
      const glm::dvec3 velocity = (now.position_m - before.position_m) / kTick_s;
      EXPECT_LE(glm::length(velocity), 3.05);
      if (tick > 1) {
        EXPECT_LE(glm::length(velocity - velocity_before) / kTick_s, 14.0) << "at " << tick * kTick_s;
      }
      EXPECT_LE(angle_between(now.rotation, before.rotation), 0.35) << "at " << tick * kTick_s;
      before = now;
      velocity_before = velocity;
    }
  }
}

TEST_P(EveryScenario, KeepsTargetsOnTheFloorAndClearOfEveryCollider) {
  Stage stage(GetParam().make());
  EmbreeDevice device;
  EmbreeScene colliders(device, EmbreeScene::Content::kColliders);
  for (double time_s = 0; time_s <= stage.duration_s(); time_s += 4 * kTick_s) {
    stage.play(time_s);
    colliders.take_in(stage.mirror());
    const std::vector<uint32_t> targets = stage.target_slots();
    for (const Role& role : stage.with_role("target")) {
      const glm::dvec3 feet = stage.pose_of(role, time_s).position_m;
      const RayHit floor = colliders.trace(feet + glm::dvec3(0, 0.5, 0), {0, -1, 0}, 0, 1, {.ignored_slots = targets});
      EXPECT_NEAR(floor.distance_m, 0.5, 1e-3) << role.name << " at " << time_s;
      for (double height_m : {0.35, 0.9, 1.5})  // along the axis of the capsule
        EXPECT_GE(colliders.nearest_surface_m(feet + glm::dvec3(0, height_m, 0), 1.0f, targets), 0.3 - 1e-3)
            << role.name << " at " << time_s;
    }
  }
}

TEST_P(EveryScenario, KeepsTargetsApartFromEachOther) {
  const Stage stage(GetParam().make());
  const std::vector<Role> targets = stage.with_role("target");
  for (double time_s = 0; time_s <= stage.duration_s(); time_s += 4 * kTick_s)
    for (size_t a = 0; a < targets.size(); ++a)
      for (size_t b = a + 1; b < targets.size(); ++b)
        EXPECT_GE(
            glm::distance(stage.pose_of(targets[a], time_s).position_m, stage.pose_of(targets[b], time_s).position_m),
            0.6)
            << "at " << time_s;
}

TEST_P(EveryScenario, StartsTheCameraInFreeSpaceLookingAtTheTargets) {
  Stage stage(GetParam().make());
  stage.play(0);
  EmbreeDevice device;
  EmbreeScene colliders(device, EmbreeScene::Content::kColliders), occluders(device, EmbreeScene::Content::kOccluders);
  colliders.take_in(stage.mirror());
  occluders.take_in(stage.mirror());
  const Pose camera = stage.pose_of(stage.with_role("camera")[0], 0);
  EXPECT_GE(colliders.nearest_surface_m(camera.position_m, 1.0f), 0.35);
  for (const Role& role : stage.with_role("target")) {
    const glm::dvec3 chest = stage.pose_of(role, 0).position_m + glm::dvec3(0, 1.1, 0);
    const glm::dvec3 in_view = inverse_transform_point(camera, chest);
    EXPECT_LT(in_view.z, 0) << role.name;
    EXPECT_LE(std::abs(in_view.x), -in_view.z * 0.647) << role.name;  // 40 degrees high, 16:9
    EXPECT_LE(std::abs(in_view.y), -in_view.z * 0.364) << role.name;
  }
}

// A moving occluder may be passable for the camera (collides: false), yet it never touches a target.
TEST_P(EveryScenario, NeverSweepsAnOccluderThroughATarget) {
  Stage stage(GetParam().make());
  EmbreeDevice device;
  EmbreeScene occluders(device, EmbreeScene::Content::kOccluders);
  for (double time_s = 0; time_s <= stage.duration_s(); time_s += 2 * kTick_s) {
    stage.play(time_s);
    occluders.take_in(stage.mirror());
    const std::vector<uint32_t> targets = stage.target_slots();
    for (const Role& role : stage.with_role("target"))
      for (double height_m : {0.35, 0.9, 1.5})
        EXPECT_GE(occluders.nearest_surface_m(stage.pose_of(role, time_s).position_m + glm::dvec3(0, height_m, 0), 1.0f,
                                              targets),
                  0.3 - 1e-3)
            << role.name << " at " << time_s;
  }
}

TEST(City, HasAbout280ThousandTrianglesForEverySeed) {
  for (uint64_t seed : {1, 5, 9}) {
    const Stage stage(make_city({.seed = seed}));
    EXPECT_GE(stage.asset().triangle_count(), 275'000u);
    EXPECT_LE(stage.asset().triangle_count(), 285'000u);
  }
}

TEST(City, SharesMeshesBetweenItsBuildings) {
  const Stage stage(make_city({}));
  size_t stored = 0;
  for (const auto& mesh : stage.asset().meshes) stored += mesh->triangle_count();
  EXPECT_LT(stored * 10, stage.asset().triangle_count());
  const auto is_building = [](const AssetNode& node) { return node.name.starts_with("building"); };
  EXPECT_EQ(std::count_if(stage.asset().nodes.begin(), stage.asset().nodes.end(), is_building), 240);
}

TEST(City, TurnsTheCornerWithinItsDuration) {
  const Stage stage(make_city({}));
  const Role target = stage.with_role("target")[0];
  const glm::dvec3 start = stage.pose_of(target, 0).position_m, end = stage.pose_of(target, 20).position_m;
  EXPECT_GE(end.x - start.x, 15.0);
  EXPECT_GE(end.z - start.z, 15.0);
}

TEST(Arena, HasAsManyTargetsAsAskedFor) {
  for (int targets : {2, 3, 8}) {
    const Stage stage(make_arena({.targets = targets}));
    EXPECT_EQ(stage.with_role("target").size(), static_cast<size_t>(targets));
  }
}

TEST(Arena, KeepsEightTargetsApart) {
  const Stage stage(make_arena({.seed = 3, .targets = 8}));
  const std::vector<Role> targets = stage.with_role("target");
  for (double time_s = 0; time_s <= 20; time_s += 0.1)
    for (size_t a = 0; a < targets.size(); ++a)
      for (size_t b = a + 1; b < targets.size(); ++b)
        EXPECT_GE(
            glm::distance(stage.pose_of(targets[a], time_s).position_m, stage.pose_of(targets[b], time_s).position_m),
            1.2);
}

TEST(Fence, MovesToAndFroBetweenTheCameraAndTheTargets) {
  const Stage stage(make_fence({}));
  const Role fence = stage.with_role("occluder").at(0);
  int turns = 0;
  double before = 0;
  for (double time_s = 0.1; time_s < 10; time_s += 0.1) {
    const double step = stage.pose_of(fence, time_s).position_m.x - stage.pose_of(fence, time_s - 0.1).position_m.x;
    turns += step * before < 0;
    before = step;
  }
  EXPECT_GE(turns, 15);  // every 0.6 s
  EXPECT_LE(turns, 17);
}

// True when the camera sees both targets, each by one point of its body: (x, y) from its feet.
bool both_seen(const Stage& stage, const EmbreeScene& occluders, double time_s, const glm::dvec2& point_m) {
  const glm::dvec3 eye = stage.pose_of(stage.with_role("camera")[0], 0).position_m;
  for (const Role& role : stage.with_role("target")) {
    const glm::dvec3 at = stage.pose_of(role, time_s).position_m + glm::dvec3(point_m, 0.0);
    const std::vector<uint32_t> ignored = stage.target_slots();
    if (occluders.trace(eye, glm::vec3(at - eye), 0, 1, {.ignored_slots = ignored}).slot != UINT32_MAX) return false;
  }
  return true;
}

// Another point at each step, of both targets the same, as the paper samples a target's extent.
TEST(Fence, HidesATargetOftenButInFewOfAnyTenSteps) {
  for (uint64_t seed : {1, 2, 3, 4, 5}) {
    Stage stage(make_fence({.seed = seed}));
    EmbreeDevice device;
    EmbreeScene occluders(device, EmbreeScene::Content::kOccluders);
    std::vector<int> hidden;
    for (int tick = 0; tick <= 600; ++tick) {
      stage.play(tick * kTick_s);
      occluders.take_in(stage.mirror());
      const glm::dvec2 point{-0.27 + 0.06 * (tick * 7 % 10), 0.9 + 0.1 * (tick * 3 % 7 - 3)};
      hidden.push_back(!both_seen(stage, occluders, tick * kTick_s, point));
    }
    const auto count = [&](auto begin, int steps) { return std::accumulate(begin, begin + steps, 0); };
    EXPECT_EQ(count(hidden.begin(), 15), 0) << "seed " << seed;
    EXPECT_GE(count(hidden.begin(), 600), 30) << "seed " << seed;
    EXPECT_LE(count(hidden.begin(), 600), 90) << "seed " << seed;
    for (int first = 0; first + 10 <= 600; ++first)
      EXPECT_LE(count(hidden.begin() + first, 10), 4) << "seed " << seed << ", from step " << first;
  }
}

// The number of targets whose chest is hidden from the camera's start.
size_t hidden_from_the_start(Stage& stage, double time_s) {
  stage.play(time_s);
  EmbreeDevice device;
  EmbreeScene occluders(device, EmbreeScene::Content::kOccluders);
  occluders.take_in(stage.mirror());
  const glm::dvec3 camera = stage.pose_of(stage.with_role("camera")[0], 0).position_m;
  const std::vector<uint32_t> targets = stage.target_slots();
  size_t hidden = 0;
  for (const Role& role : stage.with_role("target")) {
    const glm::dvec3 chest = stage.pose_of(role, time_s).position_m + glm::dvec3(0, 1.1, 0);
    const RayFilter filter{.ignored_slots = targets};
    hidden += occluders.trace(chest, glm::vec3(camera - chest), 0, 1, filter).slot != UINT32_MAX;
  }
  return hidden;
}

TEST(Fence, ItsBoardHidesBothTargetsFromThenOnAndNothingLastsBefore) {
  Stage stage(make_fence({.board_at_s = 4.0}));
  std::map<size_t, int> frames_before;
  for (double time_s = 0; time_s <= 4.0; time_s += 4 * kTick_s) ++frames_before[hidden_from_the_start(stage, time_s)];
  EXPECT_GT(frames_before[0], frames_before[2]) << "the fence hides for moments";
  for (double time_s = 4.25; time_s <= 10.0; time_s += 0.25)
    EXPECT_EQ(hidden_from_the_start(stage, time_s), 2u) << "at " << time_s;
}

TEST(Fence, HasNoBoardUnlessAsked) {
  EXPECT_EQ(Stage(make_fence({})).with_role("occluder").size(), 1u);
  EXPECT_EQ(Stage(make_fence({.board_at_s = 4.0})).with_role("occluder").size(), 2u);
}

TEST(Rooms, TargetsPassAtLeastFourDoorsOneBehindTheOther) {
  const Stage stage(make_rooms({}));
  for (const Role& target : stage.with_role("target")) {
    int rooms_changed = 0;
    glm::ivec2 room(-1);
    for (double time_s = 0; time_s < 30; time_s += 0.1) {
      const glm::dvec3 p = stage.pose_of(target, time_s).position_m;
      const glm::ivec2 now(static_cast<int>(p.x / 6), static_cast<int>(p.z / 6));
      rooms_changed += room.x >= 0 && now != room;
      room = now;
    }
    EXPECT_GE(rooms_changed, 4) << target.name;
  }
}

class HallIsHard : public testing::TestWithParam<uint64_t> {};
INSTANTIATE_TEST_SUITE_P(Seeds, HallIsHard, testing::Values(1, 2, 3, 77));

TEST_P(HallIsHard, CameraAtAFixedOffsetLosesATargetInOver15PercentOfFrames) {
  const std::vector<std::byte> bytes = make_hall({.seed = GetParam()});
  for (bool turning : {false, true}) {
    const Hidden hidden = hidden_from_fixed_offset(bytes, turning);
    RecordProperty(turning ? "turning_any_percent" : "any_percent", static_cast<int>(100 * hidden.one_or_more));
    RecordProperty(turning ? "turning_all_percent" : "all_percent", static_cast<int>(100 * hidden.all));
    EXPECT_GT(hidden.one_or_more, 0.15) << (turning ? "turning" : "not turning");
  }
}

TEST(Hall, ItsSuddenOccludersHideTargetsThatItsWallsDoNot) {
  const Hidden with = hidden_from_fixed_offset(make_hall({}), true);
  const Hidden without = hidden_from_fixed_offset(make_hall({.curtain_pause_s = 100}), true);
  EXPECT_GT(with.one_or_more, without.one_or_more + 0.05);
}

TEST(Hall, TargetsTurnSharplyAtLeastSixTimes) {
  const Stage stage(make_hall({}));
  const Role target = stage.with_role("target")[0];
  int sharp_turns = 0;
  for (double time_s = 0; time_s + 0.35 < 30; time_s += 0.35)
    sharp_turns += angle_between(stage.pose_of(target, time_s).rotation,
                                 stage.pose_of(target, time_s + 0.35).rotation) > 1.0;
  EXPECT_GE(sharp_turns, 6);
}

// Averaged over half a second, corners included.
TEST(Hall, TargetsWalkAtBetween1Point2And3MetresASecond) {
  for (uint64_t seed : {1, 2, 3, 77}) {
    const Stage stage(make_hall({.seed = seed}));
    for (const Role& role : stage.with_role("target"))
      for (double time_s = 0; time_s + 0.5 <= 30; time_s += 0.5) {
        double walked_m = 0;
        for (int tick = 0; tick < 30; ++tick)
          walked_m += glm::distance(stage.pose_of(role, time_s + tick * kTick_s).position_m,
                                    stage.pose_of(role, time_s + (tick + 1) * kTick_s).position_m);
        EXPECT_GE(walked_m / 0.5, 1.2) << role.name << " at " << time_s << ", seed " << seed;
        EXPECT_LE(walked_m / 0.5, 3.0) << role.name << " at " << time_s << ", seed " << seed;
      }
  }
}

// The camera's position at `time_s` when it keeps its first offset from the mean of the targets.
glm::dvec3 eye_behind_targets(const Stage& stage, double time_s) {
  const std::vector<Role> targets = stage.with_role("target");
  const auto middle = [&](double at_s) {
    return (stage.pose_of(targets[0], at_s).position_m + stage.pose_of(targets[1], at_s).position_m) / 2.0;
  };
  return stage.pose_of(stage.with_role("camera")[0], 0).position_m - middle(0) + middle(time_s);
}

TEST(Hall, FromTheFrontTheCameraFacesTheTargets) {
  const Stage stage(make_hall({.from_front = true}));
  const Pose camera = stage.pose_of(stage.with_role("camera")[0], 0);
  for (const Role& target : stage.with_role("target")) {
    const glm::dvec3 walks_m = stage.pose_of(target, 0.5).position_m - stage.pose_of(target, 0).position_m;
    EXPECT_GT(glm::dot(camera.position_m - stage.pose_of(target, 0).position_m, glm::normalize(walks_m)), 4.5)
        << target.name;
  }
}

// The time from the first tick at which the curtain hides the chest of one target to the first at which it hides both.
TEST(Hall, CurtainsHideBothTargetsSuddenlyAndAreDrawnInSightLongBefore) {
  for (const auto& [seed, from_front] :
       {std::pair(1, false), std::pair(2, false), std::pair(3, false), std::pair(4, false), std::pair(5, false),
        std::pair(1, true), std::pair(2, true), std::pair(3, true)}) {
    SCOPED_TRACE(from_front ? "from the front" : "from behind");
    Stage stage(make_hall({.seed = static_cast<uint64_t>(seed), .from_front = from_front}));
    EmbreeDevice device;
    EmbreeScene occluders(device, EmbreeScene::Content::kOccluders);
    const std::vector<Role> targets = stage.with_role("target"), curtains = stage.with_role("occluder");
    EXPECT_GE(curtains.size(), 6u) << "seed " << seed;
    for (const Role& curtain : curtains) {
      const uint32_t slot = *stage.mirror().slot_of(curtain.id);
      std::optional<double> moves_s, hides_one_s, hides_both_s;
      for (double time_s = 0; time_s < stage.duration_s() && !hides_both_s; time_s += kTick_s) {
        stage.play(time_s);
        occluders.take_in(stage.mirror());
        const glm::dvec3 eye = eye_behind_targets(stage, time_s);
        size_t hidden = 0;
        for (const Role& role : targets) {
          const glm::dvec3 chest = stage.pose_of(role, time_s).position_m + glm::dvec3(0, 0.9, 0);
          hidden += occluders.trace(eye, glm::vec3(chest - eye), 0, 1, {.ignored_slots = stage.target_slots()}).slot ==
                    slot;
        }
        const bool moves = glm::distance(stage.pose_of(curtain, time_s).position_m,
                                         stage.pose_of(curtain, time_s + kTick_s).position_m) > 1e-3;
        if (moves && !moves_s) moves_s = time_s;
        if (hidden > 0 && !hides_one_s) hides_one_s = time_s;
        if (hidden == targets.size()) hides_both_s = time_s;
      }
      ASSERT_TRUE(hides_both_s.has_value()) << curtain.name << ", seed " << seed;
      EXPECT_LE(*hides_both_s - *hides_one_s, 0.15) << curtain.name << ", seed " << seed;
      EXPECT_GE(*hides_one_s - *moves_s, 0.45) << curtain.name << ", seed " << seed;
    }
  }
}

}  // namespace
}  // namespace sightline
