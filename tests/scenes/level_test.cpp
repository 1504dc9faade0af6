// The levels keep their promises: every walk is swept against the geometry that the server's reader finds in the file,
// with distances by Embree. The levels of tiles are skipped where the folder of the tiles is absent (environment
// variable SIGHTLINE_TILES).
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "scenes/catalog.h"
#include "scenes/tile_set.h"
#include "server/sample/embree_scene.h"
#include "tests/scenes/stage.h"

namespace sightline {
namespace {

using namespace sightline::scenes;

constexpr double kTick_s = 1.0 / 60.0;
constexpr double kRadius_m = 0.3;  // of a target

struct LevelCase {
  std::string name;
  uint64_t seed = 1;
};

void PrintTo(const LevelCase& c, std::ostream* out) {
  *out << c.name << " seed " << c.seed;
}

// Two seeds for each level of boxes, one for each of tiles: their walks are the same.
std::vector<LevelCase> all_levels() {
  std::vector<LevelCase> cases;
  for (const CatalogEntry* entry : scenes_of(SceneGroup::kLevels))
    for (const uint64_t seed : {1, 104}) cases.push_back({entry->name, seed});
  for (const CatalogEntry* entry : scenes_of(SceneGroup::kTiles)) cases.push_back({entry->name, 2});
  return cases;
}

std::string print_level(const testing::TestParamInfo<LevelCase>& info) {
  std::string name = info.param.name + "_" + std::to_string(info.param.seed);
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
}

class EveryLevel : public testing::TestWithParam<LevelCase> {
 protected:
  void SetUp() override {
    const CatalogEntry& entry = *find_scene(GetParam().name);
    if (entry.group == SceneGroup::kTiles && tiles_folder("").empty())
      GTEST_SKIP() << "no folder of tiles: " << kTilesVariable << " is not set";
    const auto bytes = entry.make({.seed = GetParam().seed});
    ASSERT_TRUE(bytes) << to_string(bytes.error());
    bytes_ = *bytes;
    stage_ = std::make_unique<Stage>(bytes_);
  }
  std::vector<std::byte> bytes_;
  std::unique_ptr<Stage> stage_;
};
INSTANTIATE_TEST_SUITE_P(Levels, EveryLevel, testing::ValuesIn(all_levels()), print_level);

TEST_P(EveryLevel, IsTheSameBytesOnEveryRunAndDiffersFromThatOfAnotherSeed) {
  const CatalogEntry& entry = *find_scene(GetParam().name);
  EXPECT_EQ(*entry.make({.seed = GetParam().seed}), bytes_);
  EXPECT_NE(*entry.make({.seed = GetParam().seed + 1000}), bytes_);
}

TEST_P(EveryLevel, IsReadWithoutWarning) {
  EXPECT_THAT(stage_->asset().warnings, testing::IsEmpty());
  EXPECT_EQ(stage_->animation().name, "scenario");
  EXPECT_EQ(stage_->with_role("camera").size(), 1u);
  EXPECT_GE(stage_->with_role("target").size(), 1u);
}

// At every tick and at seven heights along the axis of each target. Between two ticks a target moves by 4 cm at most.
TEST_P(EveryLevel, KeepsTargetsClearOfEveryColliderAllTheWay) {
  EmbreeDevice device;
  EmbreeScene colliders(device, EmbreeScene::Content::kColliders);
  stage_->play(0);
  colliders.take_in(stage_->mirror());
  const std::vector<uint32_t> targets = stage_->target_slots();
  for (const Role& role : stage_->with_role("target"))
    for (double time_s = 0; time_s <= stage_->duration_s(); time_s += kTick_s) {
      const glm::dvec3 feet = stage_->pose_of(role, time_s).position_m;
      for (const double height_m : {0.302, 0.5, 0.7, 0.9, 1.1, 1.3, 1.5})
        ASSERT_GE(colliders.nearest_surface_m(feet + glm::dvec3(0, height_m, 0), 1.0f, targets), kRadius_m - 1e-3)
            << role.name << " at " << time_s << " s, " << feet.x << " " << feet.y << " " << feet.z;
    }
}

TEST_P(EveryLevel, KeepsTargetsOnAFloorOrWithinAStepOfIt) {
  EmbreeDevice device;
  EmbreeScene colliders(device, EmbreeScene::Content::kColliders);
  stage_->play(0);
  colliders.take_in(stage_->mirror());
  const std::vector<uint32_t> targets = stage_->target_slots();
  const RayFilter filter{.ignored_slots = targets};
  for (const Role& role : stage_->with_role("target")) {
    int above_a_step = 0, ticks = 0;
    for (double time_s = 0; time_s <= stage_->duration_s(); time_s += 6 * kTick_s, ++ticks) {
      const glm::dvec3 feet = stage_->pose_of(role, time_s).position_m;
      // A little to one side: many doors stand on the seam of two tiles.
      const double above_m = colliders.trace(feet + glm::dvec3(0.013, 0.5, 0.007), {0, -1, 0}, 0, 3, filter)
                                 .distance_m -
                             0.5;
      EXPECT_GE(above_m, -1e-3) << role.name << " at " << time_s;
      EXPECT_LE(above_m, 0.75) << role.name << " at " << time_s;
      above_a_step += above_m > 0.035;  // a joint between two tiles is 0.03 m deep
    }
    EXPECT_LE(above_a_step, ticks / 2) << "stairs are the smaller part of a level";
  }
}

TEST_P(EveryLevel, MovesTargetsWithoutJumpsAtTheSpeedOfAWalk) {
  for (const Role& role : stage_->with_role("target")) {
    double walked_m = 0;
    glm::dvec3 before = stage_->pose_of(role, 0).position_m, velocity_before{0.0};
    for (int tick = 1; tick * kTick_s < stage_->duration_s() - 1e-6; ++tick) {
      const glm::dvec3 now = stage_->pose_of(role, tick * kTick_s).position_m, velocity = (now - before) / kTick_s;
      walked_m += glm::distance(now, before);
      EXPECT_LE(glm::length(velocity), 3.0) << role.name << " at " << tick * kTick_s;
      if (tick > 1) {
        EXPECT_LE(glm::length(velocity - velocity_before) / kTick_s, 14.0) << role.name << " at " << tick * kTick_s;
      }
      before = now;
      velocity_before = velocity;
    }
    EXPECT_GE(walked_m, 1.3 * stage_->duration_s()) << role.name;
  }
}

TEST_P(EveryLevel, KeepsTargetsApartFromEachOther) {
  const std::vector<Role> targets = stage_->with_role("target");
  for (double time_s = 0; time_s <= stage_->duration_s(); time_s += 2 * kTick_s)
    for (size_t a = 0; a < targets.size(); ++a)
      for (size_t b = a + 1; b < targets.size(); ++b)
        EXPECT_GE(glm::distance(stage_->pose_of(targets[a], time_s).position_m,
                                stage_->pose_of(targets[b], time_s).position_m),
                  2 * kRadius_m)
            << "at " << time_s;
}

TEST_P(EveryLevel, StartsTheCameraInFreeSpaceWithEveryTargetInSight) {
  stage_->play(0);
  EmbreeDevice device;
  EmbreeScene colliders(device, EmbreeScene::Content::kColliders), occluders(device, EmbreeScene::Content::kOccluders);
  colliders.take_in(stage_->mirror());
  occluders.take_in(stage_->mirror());
  const std::vector<uint32_t> targets = stage_->target_slots();
  const Pose camera = stage_->pose_of(stage_->with_role("camera")[0], 0);
  EXPECT_GE(colliders.nearest_surface_m(camera.position_m, 1.0f), 0.35);
  for (const Role& role : stage_->with_role("target")) {
    const glm::dvec3 chest = stage_->pose_of(role, 0).position_m + glm::dvec3(0, 1.1, 0);
    const glm::dvec3 in_view = inverse_transform_point(camera, chest);
    EXPECT_LT(in_view.z, 0) << role.name;
    EXPECT_LE(std::abs(in_view.x), -in_view.z * 0.647) << role.name;  // 40 degrees high, 16:9
    EXPECT_LE(std::abs(in_view.y), -in_view.z * 0.364) << role.name;
    const RayFilter filter{.ignored_slots = targets};
    EXPECT_EQ(occluders.trace(camera.position_m, glm::vec3(chest - camera.position_m), 0, 1, filter).slot, UINT32_MAX)
        << role.name;
  }
}

// Furniture is placed by the sizes in the table, so no part may be larger.
void expect_furniture_fits(const PartMeshes& parts) {
  for (auto k = static_cast<size_t>(kFirstFurniture); k < kPartCount; ++k) {
    const PartKind& kind = kind_of(static_cast<Part>(k));
    ASSERT_FALSE(parts[k].indices.empty()) << kind.name;
    for (const glm::vec3& p : parts[k].positions) {
      EXPECT_LE(std::abs(p.x), kind.half_m.x + 0.01) << kind.name;
      EXPECT_LE(std::abs(p.z), kind.half_m.y + 0.01) << kind.name;
      EXPECT_GE(p.y, -0.01) << kind.name;
      EXPECT_LE(p.y, kind.height_m + 0.01) << kind.name;
    }
  }
}

TEST(LevelParts, OfBoxesAreNoLargerThanTheTableSays) {
  expect_furniture_fits(block_parts());
}

TEST(LevelParts, OfTilesAreNoLargerThanTheTableSays) {
  if (tiles_folder("").empty()) GTEST_SKIP() << "no folder of tiles: " << kTilesVariable << " is not set";
  const auto parts = read_tiles(tiles_folder(""));
  ASSERT_TRUE(parts) << to_string(parts.error());
  expect_furniture_fits(*parts);
}

TEST(LevelParts, OfAFolderWithoutTilesAreRefusedWithItsName) {
  const auto parts = read_tiles("no-such-folder");
  ASSERT_FALSE(parts);
  EXPECT_EQ(parts.error().code, ErrorCode::kNotFound);
  EXPECT_THAT(parts.error().message, testing::HasSubstr("no-such-folder"));
}

TEST(Levels, OfTilesHaveTheWalksAndTheFurnitureOfThoseOfBoxes) {
  if (tiles_folder("").empty()) GTEST_SKIP() << "no folder of tiles: " << kTilesVariable << " is not set";
  for (const CatalogEntry* entry : scenes_of(SceneGroup::kLevels)) {
    const Stage boxes(*entry->make({.seed = 3})),
        tiles(*find_scene("tile-" + entry->name.substr(6))->make({.seed = 3}));
    ASSERT_EQ(boxes.asset().nodes.size(), tiles.asset().nodes.size()) << entry->name;
    for (size_t n = 0; n < boxes.asset().nodes.size(); ++n) {
      EXPECT_EQ(boxes.asset().nodes[n].name, tiles.asset().nodes[n].name) << entry->name;
      EXPECT_EQ(boxes.asset().nodes[n].translation_m, tiles.asset().nodes[n].translation_m) << entry->name;
    }
    for (const Role& role : boxes.with_role("target"))
      for (double time_s = 0; time_s < boxes.duration_s(); time_s += 1.0)
        EXPECT_EQ(boxes.pose_of(role, time_s).position_m, tiles.pose_of(role, time_s).position_m) << entry->name;
  }
}

TEST(Levels, LeadTheirTargetsThroughAtLeastFourRooms) {
  for (const char* name : {"level-rooms-one", "level-rooms-four", "level-roofed-row", "level-rooms-parted"}) {
    const Stage stage(*find_scene(name)->make({.seed = 5}));
    for (const Role& role : stage.with_role("target")) {
      std::set<std::pair<int, int>> rooms;
      for (double time_s = 0; time_s < stage.duration_s(); time_s += 0.25) {
        const glm::dvec3 p = stage.pose_of(role, time_s).position_m;
        rooms.insert({static_cast<int>(p.x / 8), static_cast<int>(p.z / 8)});
      }
      EXPECT_GE(rooms.size(), 4u) << name << " " << role.name;
    }
  }
}

TEST(Levels, PartTheirTwoTargetsByAWall) {
  for (const uint64_t seed : {1, 2, 3}) {
    Stage stage(*find_scene("level-rooms-parted")->make({.seed = seed}));
    const std::vector<Role> targets = stage.with_role("target");
    double parted_s = 0;
    for (double time_s = 0; time_s < stage.duration_s(); time_s += 0.25) {
      const glm::dvec3 a = stage.pose_of(targets[0], time_s).position_m,
                       b = stage.pose_of(targets[1], time_s).position_m;
      parted_s += a.z < 7.5 && b.z > 8.5 ? 0.25 : 0.0;  // in rows 0 and 1
    }
    EXPECT_GE(parted_s, 9) << "seed " << seed;
    EXPECT_LT(glm::distance(stage.pose_of(targets[0], 38).position_m, stage.pose_of(targets[1], 38).position_m), 6);
  }
}

TEST(Levels, OfTwoStoreysLeadUpAndDownAgain) {
  for (const uint64_t seed : {1, 2, 3}) {
    const Stage stage(*find_scene("level-storeys-one")->make({.seed = seed}));
    const Role role = stage.with_role("target")[0];
    double highest_m = 0;
    for (double time_s = 0; time_s < stage.duration_s(); time_s += 0.25)
      highest_m = std::max(highest_m, stage.pose_of(role, time_s).position_m.y);
    EXPECT_GT(highest_m, 4) << "seed " << seed;
    EXPECT_LT(highest_m, 4.3) << "seed " << seed;
    EXPECT_LT(stage.pose_of(role, stage.duration_s()).position_m.y, 4) << "on the way down, or down; seed " << seed;
  }
}

}  // namespace
}  // namespace sightline
