// The scenes of the groups `situations` and `roofs`: what all of them promise, and for each the fact that it was made
// for.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "scenes/catalog.h"
#include "scenes/roofs.h"
#include "server/sample/embree_scene.h"
#include "tests/scenes/stage.h"

namespace sightline {
namespace {

using namespace sightline::scenes;

constexpr double kTick_s = 1.0 / 60.0;

std::vector<std::byte> made(const std::string& name, uint64_t seed) {
  const auto bytes = find_scene(name)->make({.seed = seed});
  if (!bytes) throw std::runtime_error(to_string(bytes.error()));
  return *bytes;
}

// Points of a target's body, in its own frame, and how far from every collider they must be. The shapes follow from the
// meshes: a capsule, a car, a ball.
struct BodyPoints {
  std::vector<glm::dvec3> points_m;
  double radius_m = 0;
};
BodyPoints points_of(const Stage& stage, const Role& role) {
  const int mesh = stage.asset().nodes[static_cast<size_t>(role.node)].mesh;
  const std::string& name = stage.asset().mesh_names[static_cast<size_t>(mesh)];
  if (name == "ball") return {{{0, 0.11, 0}}, 0.11};
  if (name == "car") return {{{0, 0.9, -1.2}, {0, 0.9, 0}, {0, 0.9, 1.2}}, 0.85};
  return {{{0, 0.302, 0}, {0, 0.6, 0}, {0, 0.9, 0}, {0, 1.2, 0}, {0, 1.5, 0}}, 0.3};
}

class EverySituation : public testing::TestWithParam<std::string> {};
std::vector<std::string> all_situations() {
  std::vector<std::string> names;
  for (const SceneGroup group : {SceneGroup::kSituations, SceneGroup::kRoofs})
    for (const CatalogEntry* entry : scenes_of(group)) names.push_back(entry->name);
  return names;
}
std::string print_situation(const testing::TestParamInfo<std::string>& scene) {
  std::string name = scene.param;
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
}
INSTANTIATE_TEST_SUITE_P(Scenes, EverySituation, testing::ValuesIn(all_situations()), print_situation);

TEST_P(EverySituation, IsTheSameBytesOnEveryRunAndDiffersFromThatOfAnotherSeed) {
  EXPECT_EQ(made(GetParam(), 1), made(GetParam(), 1));
  EXPECT_NE(made(GetParam(), 1), made(GetParam(), 2));
}

TEST_P(EverySituation, IsReadWithoutWarning) {
  const Stage stage(made(GetParam(), 3));
  EXPECT_THAT(stage.asset().warnings, testing::IsEmpty());
  EXPECT_EQ(stage.animation().name, "scenario");
  EXPECT_EQ(stage.with_role("camera").size(), 1u);
  EXPECT_GE(stage.with_role("target").size(), 1u);
}

TEST_P(EverySituation, KeepsTargetsClearOfEveryColliderAllTheWay) {
  for (const uint64_t seed : {1, 104}) {
    Stage stage(made(GetParam(), seed));
    EmbreeDevice device;
    EmbreeScene colliders(device, EmbreeScene::Content::kColliders);
    const std::vector<uint32_t> targets = stage.target_slots();
    for (double time_s = 0; time_s <= stage.duration_s(); time_s += 2 * kTick_s) {
      stage.play(time_s);
      colliders.take_in(stage.mirror());
      for (const Role& role : stage.with_role("target")) {
        const BodyPoints body = points_of(stage, role);
        const Pose pose = stage.pose_of(role, time_s);
        for (const glm::dvec3& p : body.points_m)
          ASSERT_GE(colliders.nearest_surface_m(transform_point(pose, p), 1.0f, targets), body.radius_m - 1e-3)
              << role.name << " at " << time_s << " s, seed " << seed;
      }
    }
  }
}

TEST_P(EverySituation, NeverMovesATargetIntoAnother) {
  const Stage stage(made(GetParam(), 2));
  const std::vector<Role> targets = stage.with_role("target");
  for (double time_s = 0; time_s <= stage.duration_s(); time_s += 2 * kTick_s)
    for (size_t a = 0; a < targets.size(); ++a)
      for (size_t b = a + 1; b < targets.size(); ++b)
        EXPECT_GE(
            glm::distance(stage.pose_of(targets[a], time_s).position_m, stage.pose_of(targets[b], time_s).position_m),
            points_of(stage, targets[a]).radius_m + points_of(stage, targets[b]).radius_m)
            << "at " << time_s;
}

TEST_P(EverySituation, StartsTheCameraInFreeSpaceWithEveryTargetInSight) {
  if (GetParam() == "walled-in") GTEST_SKIP() << "its camera starts inside a wall";
  for (const uint64_t seed : {1, 104}) {
    Stage stage(made(GetParam(), seed));
    stage.play(0);
    EmbreeDevice device;
    EmbreeScene colliders(device, EmbreeScene::Content::kColliders),
        occluders(device, EmbreeScene::Content::kOccluders);
    colliders.take_in(stage.mirror());
    occluders.take_in(stage.mirror());
    const std::vector<uint32_t> targets = stage.target_slots();
    const Pose camera = stage.pose_of(stage.with_role("camera")[0], 0);
    EXPECT_GE(colliders.nearest_surface_m(camera.position_m, 1.0f), 0.35) << "seed " << seed;
    for (const Role& role : stage.with_role("target")) {
      const BodyPoints body = points_of(stage, role);
      const glm::dvec3 middle = transform_point(stage.pose_of(role, 0), body.points_m[body.points_m.size() / 2]);
      const glm::dvec3 in_view = inverse_transform_point(camera, middle);
      EXPECT_LT(in_view.z, 0) << role.name;
      EXPECT_LE(std::abs(in_view.x), -in_view.z * 0.647) << role.name << ", seed " << seed;  // 40 degrees high, 16:9
      EXPECT_LE(std::abs(in_view.y), -in_view.z * 0.364) << role.name << ", seed " << seed;
      const RayFilter filter{.ignored_slots = targets};
      EXPECT_EQ(occluders.trace(camera.position_m, glm::vec3(middle - camera.position_m), 0, 1, filter).slot,
                UINT32_MAX)
          << role.name << ", seed " << seed;
    }
  }
}

// ---- what each was made for ----

glm::dvec3 place(const Stage& stage, const std::string& role, size_t which, double time_s) {
  return stage.pose_of(stage.with_role(role)[which], time_s).position_m;
}
double speed_mps(const Stage& stage, double time_s) {
  return glm::distance(place(stage, "target", 0, time_s + kTick_s), place(stage, "target", 0, time_s)) / kTick_s;
}

// How far a person is from the one that is nearest.
double nearest_m(const Stage& stage, size_t person, double time_s) {
  double nearest_m = INFINITY;
  for (size_t other = 0; other < stage.with_role("target").size(); ++other)
    if (other != person)
      nearest_m = std::min(
          nearest_m, glm::distance(place(stage, "target", person, time_s), place(stage, "target", other, time_s)));
  return nearest_m;
}

TEST(Roofs, PeopleStandOneAndAHalfToFiveMetresApart) {
  for (uint64_t seed = 1; seed <= 8; ++seed)
    for (const int people : {2, 3, 4}) {
      const Stage stage(make_roofs({.seed = seed, .people = people}));
      ASSERT_EQ(stage.with_role("target").size(), static_cast<size_t>(people));
      for (size_t person = 0; person < static_cast<size_t>(people); ++person) {
        EXPECT_NEAR(nearest_m(stage, person, 0), 1.5 + 0.5 * static_cast<double>(seed - 1), 1e-3);
        EXPECT_EQ(place(stage, "target", person, 0), place(stage, "target", person, 20));
      }
    }
}

TEST(Roofs, PeopleWhoWalkDoSoEachOnAWayOfTheirOwn) {
  for (uint64_t seed = 1; seed <= 8; ++seed) {
    const Stage stage(make_roofs({.seed = seed, .people = 3, .walk = true}));
    const double gap_m = 1.5 + 0.5 * static_cast<double>(seed - 1);
    for (size_t person = 0; person < 3; ++person) {
      double way_m = 0, aside_m = 0;
      const glm::dvec3 from_first_m = place(stage, "target", person, 0) - place(stage, "target", (person + 1) % 3, 0);
      for (double time_s = 0; time_s < 20; time_s += 0.1) {
        way_m += glm::distance(place(stage, "target", person, time_s), place(stage, "target", person, time_s + 0.1));
        const glm::dvec3 now_m = place(stage, "target", person, time_s) -
                                 place(stage, "target", (person + 1) % 3, time_s);
        aside_m = std::max(aside_m, glm::distance(now_m, from_first_m));
        EXPECT_GT(nearest_m(stage, person, time_s), 0.5 * gap_m);
        EXPECT_LT(nearest_m(stage, person, time_s), 1.6 * gap_m);
      }
      EXPECT_GT(way_m, 8);
      EXPECT_GT(aside_m, 0.2 * gap_m);
    }
  }
}

TEST(Roofs, HaveACeilingOfTwoAndAHalfToFourMetresOverEverybody) {
  std::vector<double> ceilings_m;
  for (uint64_t seed = 1; seed <= 4; ++seed)
    for (const RoofsOptions& options :
         {RoofsOptions{.seed = seed}, RoofsOptions{.seed = seed, .walk = true, .corridor = true}}) {
      Stage stage(make_roofs(options));
      stage.play(10);
      EmbreeDevice device;
      EmbreeScene colliders(device, EmbreeScene::Content::kColliders);
      colliders.take_in(stage.mirror());
      const std::vector<uint32_t> targets = stage.target_slots();
      const RayFilter filter{.ignored_slots = targets};
      for (size_t person = 0; person < 2; ++person) {
        const RayHit hit = colliders.trace(place(stage, "target", person, 10) + glm::dvec3(0, 1, 0), {0, 1, 0}, 0, 10,
                                           filter);
        ceilings_m.push_back(1 + hit.distance_m);
      }
    }
  EXPECT_NEAR(*std::min_element(ceilings_m.begin(), ceilings_m.end()), 2.5, 1e-3);
  EXPECT_NEAR(*std::max_element(ceilings_m.begin(), ceilings_m.end()), 4.0, 1e-3);
}

TEST(CorridorNarrow, IsOneMetreWide) {
  const Stage stage(made("corridor-narrow", 1));
  EmbreeDevice device;
  EmbreeScene colliders(device, EmbreeScene::Content::kColliders);
  colliders.take_in(stage.mirror());
  const std::vector<uint32_t> targets = stage.target_slots();
  const RayFilter filter{.ignored_slots = targets};
  int narrow = 0, ticks = 0;
  for (double time_s = 0; time_s < stage.duration_s(); time_s += 0.1, ++ticks) {
    const glm::dvec3 at = place(stage, "target", 0, time_s) + glm::dvec3(0, 1, 0);
    const auto free_m = [&](const glm::vec3& way) {
      return colliders.trace(at, way, 0, 20, filter).distance_m + colliders.trace(at, -way, 0, 20, filter).distance_m;
    };
    const double width_m = std::min(free_m({1, 0, 0}), free_m({0, 0, 1}));
    EXPECT_GE(width_m, 1.0 - 1e-3) << time_s;
    narrow += width_m < 1.0 + 1e-3;
  }
  EXPECT_GT(narrow, ticks * 7 / 10) << "the rest is at side passages";
}

TEST(Maze, LeadsTheTargetsOverMuchMoreThanTheDistanceThatTheyCover) {
  for (const uint64_t seed : {1, 2, 3}) {
    const Stage stage(made("maze", seed));
    double walked_m = 0;
    for (double time_s = 0; time_s + 0.1 < stage.duration_s(); time_s += 0.1)
      walked_m += glm::distance(place(stage, "target", 0, time_s + 0.1), place(stage, "target", 0, time_s));
    EXPECT_GT(walked_m, 40) << "seed " << seed;
    EXPECT_GT(walked_m, 2 * glm::distance(place(stage, "target", 0, 0), place(stage, "target", 0, 39)))
        << "seed " << seed;
  }
}

TEST(Stairwell, LeadsTheTargetUpAtLeastTwoStoreys) {
  for (const uint64_t seed : {1, 2, 3}) {
    const Stage stage(made("stairwell", seed));
    double before_m = 0, highest_m = 0;
    for (double time_s = 0; time_s < stage.duration_s(); time_s += 0.5) {
      const double now_m = place(stage, "target", 0, time_s).y;
      EXPECT_GE(now_m, before_m - 0.1) << "it never goes down, but for the step onto a landing";
      before_m = now_m;
      highest_m = std::max(highest_m, now_m);
    }
    EXPECT_GT(highest_m, 6.4) << "seed " << seed;
  }
}

TEST(Lift, CarriesTheTargetInItsCabin) {
  for (const uint64_t seed : {1, 2, 3}) {
    const Stage stage(made("lift", seed));
    int rides = 0, rising = 0;
    for (double time_s = 0; time_s + kTick_s < stage.duration_s(); time_s += kTick_s) {
      const glm::dvec3 cabin = place(stage, "occluder", 0, time_s), target = place(stage, "target", 0, time_s);
      const bool moves = std::abs(place(stage, "occluder", 0, time_s + kTick_s).y - cabin.y) > 0.01;
      if (moves) {
        EXPECT_NEAR(target.y, cabin.y, 1e-3) << time_s;
        EXPECT_LT(std::hypot(target.x - cabin.x, target.z - cabin.z), 0.3) << time_s;
      }
      rides += moves && rising == 0;
      rising = moves ? 30 : std::max(0, rising - 1);
    }
    EXPECT_EQ(rides, 2) << "seed " << seed;
  }
}

TEST(Street, DrivesTheCarAtVehicleSpeedRoundSeveralCornersClearOfTheTraffic) {
  for (const uint64_t seed : {1, 2, 3, 4}) {
    const Stage stage(made("street", seed));
    double fastest_mps = 0, turned_rad = 0;
    for (double time_s = 0; time_s + 0.1 < stage.duration_s(); time_s += 0.1) {
      fastest_mps = std::max(fastest_mps, speed_mps(stage, time_s));
      turned_rad += angle_between(stage.pose_of(stage.with_role("target")[0], time_s + 0.1).rotation,
                                  stage.pose_of(stage.with_role("target")[0], time_s).rotation);
      for (size_t k = 0; k < stage.with_role("occluder").size(); ++k)
        EXPECT_GE(glm::distance(place(stage, "occluder", k, time_s), place(stage, "target", 0, time_s)), 8.9) << time_s;
    }
    EXPECT_GE(fastest_mps, 14) << "seed " << seed;
    EXPECT_LE(fastest_mps, 30.1) << "seed " << seed;
    EXPECT_GE(turned_rad, 2.9) << "two corners or more, seed " << seed;
    EXPECT_GE(stage.with_role("occluder").size(), 10u);
  }
}

TEST(Block, HidesTheWaitingCarFromEverywhereOnTheGroundBeforeIt) {
  for (const uint64_t seed : {1, 2, 3}) {
    const Stage stage(made("block", seed));
    EmbreeDevice device;
    EmbreeScene occluders(device, EmbreeScene::Content::kOccluders);
    occluders.take_in(stage.mirror());
    double fastest_mps = 0;
    for (double time_s = 0; time_s < 20; time_s += 0.1) fastest_mps = std::max(fastest_mps, speed_mps(stage, time_s));
    EXPECT_NEAR(fastest_mps, 20, 0.5);
    const glm::dvec3 end = place(stage, "target", 0, stage.duration_s()), start = place(stage, "target", 0, 0);
    EXPECT_LT(glm::distance(place(stage, "target", 0, stage.duration_s() - 25), end), 1e-3) << "it waits for 25 s";
    const std::vector<uint32_t> targets = stage.target_slots();
    const glm::dvec3 from = start + glm::dvec3(0, 2, 0), way = end + glm::dvec3(0, 1, 0) - from;
    EXPECT_NE(occluders.trace(from, glm::vec3(way), 0, 1, {.ignored_slots = targets}).slot, UINT32_MAX)
        << "seed " << seed;
  }
}

TEST(Pitch, Has22PlayersAndABallThatChangesHands) {
  for (const uint64_t seed : {1, 2}) {
    const Stage stage(made("pitch", seed));
    EXPECT_EQ(stage.with_role("target").size(), 3u);
    EXPECT_EQ(stage.with_role("occluder").size(), 20u);
    int changes = 0, holder = 0;
    for (double time_s = 0; time_s < stage.duration_s(); time_s += 0.1) {
      const glm::dvec3 ball = place(stage, "target", 2, time_s);
      for (const int runner : {0, 1})
        if (glm::distance(ball, place(stage, "target", static_cast<size_t>(runner), time_s)) < 1.0) {
          changes += runner != holder;
          holder = runner;
        }
      EXPECT_LE(std::abs(ball.x), 52.5) << time_s;
      EXPECT_LE(std::abs(ball.z), 34.0) << time_s;
    }
    EXPECT_GE(changes, 15) << "seed " << seed;
  }
}

TEST(Sprint, IsFasterThanTheCameraMayBeAndThenSlower) {
  const std::pair<const char*, double> scenes[] = {{"sprint-10", 10}, {"sprint-12", 12}, {"sprint-40", 40}};
  for (const auto& [name, limit_mps] : scenes) {
    const Stage stage(made(name, 1));
    EXPECT_NEAR(speed_mps(stage, 15), 1.3 * limit_mps, 0.02 * limit_mps) << name;
    EXPECT_NEAR(speed_mps(stage, 35), 0.8 * limit_mps, 0.02 * limit_mps) << name;
  }
}

TEST(Parting, ItsTargetsAreSixtyMetresApartAndMeetAgain) {
  const Stage stage(made("parting", 1));
  const auto apart_m = [&](double time_s) {
    return glm::distance(place(stage, "target", 0, time_s), place(stage, "target", 1, time_s));
  };
  EXPECT_NEAR(apart_m(0), 1.2, 0.01);
  EXPECT_NEAR(apart_m(30), 60, 0.1);
  EXPECT_NEAR(apart_m(58), 1.2, 0.1);
}

TEST(Leaving, OneTargetIsGoneForGood) {
  const Stage stage(made("leaving", 1));
  const auto apart_m = [&](double time_s) {
    return glm::distance(place(stage, "target", 0, time_s), place(stage, "target", 1, time_s));
  };
  EXPECT_NEAR(apart_m(0), 1.2, 0.01);
  EXPECT_GT(apart_m(stage.duration_s()), 200);
}

TEST(Teleport, JumpsByTwentyMetresThreeTimes) {
  const Stage stage(made("teleport", 1));
  int jumps = 0;
  for (int tick = 0; (tick + 1) * kTick_s < stage.duration_s(); ++tick) {
    const double moved_m = glm::distance(place(stage, "target", 0, (tick + 1) * kTick_s),
                                         place(stage, "target", 0, tick * kTick_s));
    if (moved_m < 0.1) continue;
    EXPECT_NEAR(moved_m, 20, 0.1);
    ++jumps;
  }
  EXPECT_EQ(jumps, 3);
}

TEST(WalledIn, StartsTheCameraInTheMiddleOfAWall) {
  for (const uint64_t seed : {1, 2, 3, 4, 5}) {
    const Stage stage(made("walled-in", seed));
    EmbreeDevice device;
    EmbreeScene colliders(device, EmbreeScene::Content::kColliders);
    colliders.take_in(stage.mirror());
    const glm::dvec3 eye = place(stage, "camera", 0, 0);
    EXPECT_NEAR(colliders.nearest_surface_m(eye, 1.0f), 0.15, 1e-3) << "seed " << seed;
  }
}

}  // namespace
}  // namespace sightline
