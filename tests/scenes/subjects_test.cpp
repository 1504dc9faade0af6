// The scenes of the groups `subjects` and `motion`: bodies and walls keep apart, the camera starts in free space, and
// each is what it was made for. Recorded motion is skipped where its folder is absent (environment variable
// SIGHTLINE_MOTION).
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "scenes/catalog.h"
#include "scenes/motion_tracks.h"
#include "server/sample/embree_scene.h"
#include "tests/scenes/stage.h"

namespace sightline {
namespace {

using namespace sightline::scenes;

constexpr double kTick_s = 1.0 / 60.0;

class EverySubject : public testing::TestWithParam<std::string> {
 protected:
  void SetUp() override {
    if (find_scene(GetParam())->group == SceneGroup::kMotion && motion_folder("").empty())
      GTEST_SKIP() << "no folder of motion: " << kMotionVariable << " is not set";
  }
  static std::vector<std::byte> made(uint64_t seed) {
    const auto bytes = find_scene(GetParam())->make({.seed = seed});
    if (!bytes) throw std::runtime_error(to_string(bytes.error()));
    return *bytes;
  }
};
std::vector<std::string> all_names() {
  std::vector<std::string> names;
  for (const SceneGroup group : {SceneGroup::kSubjects, SceneGroup::kMotion})
    for (const CatalogEntry* entry : scenes_of(group)) names.push_back(entry->name);
  return names;
}
std::string print_name(const testing::TestParamInfo<std::string>& scene) {
  std::string name = scene.param;
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
}
INSTANTIATE_TEST_SUITE_P(Scenes, EverySubject, testing::ValuesIn(all_names()), print_name);

TEST_P(EverySubject, IsTheSameBytesOnEveryRunAndReadWithoutWarning) {
  EXPECT_EQ(made(1), made(1));
  EXPECT_NE(made(1), made(2));
  const Stage stage(made(3));
  EXPECT_THAT(stage.asset().warnings, testing::IsEmpty());
  EXPECT_EQ(stage.with_role("camera").size(), 1u);
  EXPECT_GE(stage.with_role("target").size(), 1u);
}

// What moves is judged by its axis, 0.1 m above the floor; real people brush along walls.
TEST_P(EverySubject, KeepsBodiesOutOfWallsAndColumns) {
  for (const uint64_t seed : {1, 104}) {
    Stage stage(made(seed));
    EmbreeDevice device;
    EmbreeScene colliders(device, EmbreeScene::Content::kColliders);
    const std::vector<uint32_t> targets = stage.target_slots();
    for (double time_s = 0; time_s <= stage.duration_s(); time_s += 6 * kTick_s) {
      stage.play(time_s);
      colliders.take_in(stage.mirror());
      for (const Role& role : stage.with_role("target")) {
        const glm::dvec3 p = stage.pose_of(role, time_s).position_m;
        ASSERT_GE(colliders.nearest_surface_m({p.x, std::max(p.y, 0.6), p.z}, 1.0f, targets), 0.1)
            << role.name << " at " << time_s << " s, seed " << seed;
      }
    }
  }
}

TEST_P(EverySubject, StartsTheCameraInFreeSpace) {
  for (const uint64_t seed : {1, 2, 104}) {
    Stage stage(made(seed));
    stage.play(0);
    EmbreeDevice device;
    EmbreeScene colliders(device, EmbreeScene::Content::kColliders);
    colliders.take_in(stage.mirror());
    const Pose camera = stage.pose_of(stage.with_role("camera")[0], 0);
    EXPECT_GE(colliders.nearest_surface_m(camera.position_m, 1.0f), 0.35) << "seed " << seed;
  }
}

glm::dvec3 place(const Stage& stage, const std::string& role, size_t which, double time_s) {
  return stage.pose_of(stage.with_role(role)[which], time_s).position_m;
}

TEST(Subjects, TheCycleHasOneTargetAtATimeAndGoesToANeighbour) {
  for (const auto& [name, apart_m] : {std::pair("cycle", 5.0), std::pair("cycle-far", 25.0)}) {
    const Stage stage(*find_scene(name)->make({.seed = 3}));
    struct Turn {
      double from_s, to_s;
      size_t target;
    };
    std::vector<Turn> turns;
    const std::vector<Role> targets = stage.with_role("target");
    for (size_t k = 0; k < targets.size(); ++k) {
      const auto extras = nlohmann::json::parse(stage.asset().nodes[static_cast<size_t>(targets[k].node)].extras_json);
      for (const auto& span : extras.at("sightline").at("during"))
        turns.push_back({span[0].get<double>(), span[1].get<double>(), k});
    }
    std::ranges::sort(turns, {}, &Turn::from_s);
    ASSERT_GE(turns.size(), 5u);
    EXPECT_EQ(turns.front().from_s, 0);
    EXPECT_GT(turns.back().to_s, stage.duration_s());
    for (size_t i = 1; i < turns.size(); ++i) {
      EXPECT_EQ(turns[i].from_s, turns[i - 1].to_s);
      const double gap_m = glm::distance(place(stage, "target", turns[i].target, turns[i].from_s),
                                         place(stage, "target", turns[i - 1].target, turns[i].from_s));
      EXPECT_NEAR(gap_m, apart_m, 2.9) << name << " at " << turns[i].from_s;
    }
  }
}

// More than 80 degrees at each crossing, at a speed of 5 m/s between them.
TEST(Subjects, TheRunnerTurnsAtEveryCrossing) {
  const Stage stage(*find_scene("runner")->make({.seed = 5}));
  const auto way = [&](double time_s) {
    return place(stage, "target", 0, time_s + 0.05) - place(stage, "target", 0, time_s - 0.05);
  };
  constexpr double kLeg_s = 8.0 / 5.0;
  for (double turn_s = 2 * kLeg_s; turn_s + 0.6 < stage.duration_s(); turn_s += kLeg_s) {
    const glm::dvec3 before = way(turn_s - 0.5), after = way(turn_s + 0.5);
    EXPECT_NEAR(glm::length(before) / 0.1, 5.0, 0.05);
    EXPECT_LT(glm::dot(glm::normalize(before), glm::normalize(after)), 0.1) << turn_s;
  }
}

TEST(Subjects, TheTwoWhoTalkStayFaceToFace) {
  const Stage stage(*find_scene("conversation")->make({.seed = 2}));
  for (double time_s = 0; time_s <= stage.duration_s(); time_s += 0.25) {
    const glm::dvec3 listener = place(stage, "occluder", 0, time_s), speaker = place(stage, "target", 0, time_s);
    const double apart_m = std::hypot(listener.x - speaker.x, listener.z - speaker.z);
    EXPECT_GE(apart_m, 1.0);
    EXPECT_LE(apart_m, 2.3);
  }
}

// ---- recorded motion ----

struct Folder {
  std::filesystem::path path = std::filesystem::temp_directory_path() /
                               ("sightline-motion-" + std::to_string(reinterpret_cast<uintptr_t>(this)));
  Folder() { std::filesystem::create_directories(path); }
  ~Folder() { std::filesystem::remove_all(path); }
  void write(const char* name, const std::string& text) const { std::ofstream(path / name) << text; }
};

TEST(MotionTracks, AreReadAndPlacedAndGoOnStraight) {
  const Folder folder;
  std::string text = "#framerate: 16\n# ID\tframe\tX\tY\tZ\n";
  for (int frame = 32; frame <= 64; ++frame)  // 2 m/s along -x in the file
    text += "7\t" + std::to_string(frame) + "\t" + std::to_string(0.5 - (frame - 32) * 0.125) + "\t-1.0\t1.75\n";
  folder.write("corner_traj.txt", text);
  const auto tracks = read_corner(folder.path.string());
  ASSERT_TRUE(tracks) << to_string(tracks.error());
  ASSERT_EQ(tracks->size(), 1u);
  const Track& track = tracks->front();
  EXPECT_EQ(track.id, 7);
  EXPECT_EQ(track.first_s, 2.0);
  EXPECT_EQ(track.last_s(), 4.0);
  for (const double time_s : {0.0, 2.0, 2.7, 4.0, 9.0}) {
    const glm::dvec3 p = track.position_m(time_s);
    EXPECT_NEAR(p.x, -2.0 + 2.0 * (time_s - 2.0), 1e-9) << time_s;
    EXPECT_NEAR(p.z, 0.5, 1e-9);
  }
}

TEST(MotionTracks, WhatIsNoRecordingIsRefusedByName) {
  const Folder folder;
  EXPECT_EQ(read_attack("no-such-folder").error().code, ErrorCode::kNotFound);
  folder.write("football_goal.csv", "player,frame,x,y,z,team\n0,0,42,oops,0,\n");
  const auto broken = read_attack(folder.path.string());
  ASSERT_FALSE(broken);
  EXPECT_EQ(broken.error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(broken.error().field, "motion");
  EXPECT_NE(broken.error().message.find("oops"), std::string::npos);
  folder.write("football_goal.csv", "player,frame,x,y,z,team\n0,0,42,97,0,\n0,2,42,97,0,\n");
  EXPECT_NE(read_attack(folder.path.string()).error().message.find("missing"), std::string::npos);
}

TEST(MotionTracks, TheRecordingsAreThoseOfPeople) {
  if (motion_folder("").empty()) GTEST_SKIP() << "no folder of motion: " << kMotionVariable << " is not set";
  const auto corner = read_corner(motion_folder("")), attack = read_attack(motion_folder(""));
  ASSERT_TRUE(corner);
  ASSERT_TRUE(attack);
  EXPECT_EQ(corner->size(), 137u);
  EXPECT_EQ(attack->front().id, 0) << "the ball";
  for (const Track& track : *corner) {
    for (const glm::dvec3& p : track.positions_m) {
      ASSERT_LE(std::max(p.x, -p.z), 1.5) << track.id;   // inside the outer walls
      ASSERT_TRUE(p.x > -1.5 || p.z < 1.5) << track.id;  // and not in the inner corner
    }
    const double mean_mps = glm::distance(track.positions_m.front(), track.positions_m.back()) /
                            (track.last_s() - track.first_s);
    EXPECT_GT(mean_mps, 0.3);
    EXPECT_LT(mean_mps, 2.0);
  }
}

}  // namespace
}  // namespace sightline
