// The policies: the baselines against brute force, and what every policy promises.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "client/evaluate/evaluation.h"
#include "client/evaluate/policy_raycast.h"
#include "client/evaluate/policy_spring_arm.h"
#include "scenes/glb_writer.h"
#include "scenes/hall.h"
#include "scenes/rooms.h"
#include "scenes/subjects.h"
#include "server/sample/embree_sampler.h"
#include "server/scene/gltf.h"
#include "server/scene/primitives.h"

namespace sightline {
namespace {

// A scenario and what a policy needs.
struct Place {
  GeometryStore store;
  EmbreeDevice device;
  std::unique_ptr<SamplerDevice> samplers = make_embree_sampler_device();
  ExtentCache extents;
  Scenario scenario;

  explicit Place(const std::vector<std::byte>& glb)
      : scenario(*Scenario::from_asset(*read_gltf(glb, nullptr, store))) {}
  PolicySite site() { return {scenario, store, device, *samplers, extents, CameraLimits{}, 1.0 / 60, 1}; }
  std::unique_ptr<ScenarioWorld> world() { return *ScenarioWorld::make(scenario, store, device); }
};

TEST(SpringArm, EasesInAndOutAndNeverReachesBehindTheSurfaceThatStoppedIt) {
  const SpringArmSettings settings;
  EXPECT_EQ(spring_arm_length_m(-1, 3, 0, settings), 3) << "the first time at once";
  EXPECT_NEAR(spring_arm_length_m(5, 4.9, 0.2, settings), 4.901, 1e-9) << "99 % of the way in after 0.2 s";
  EXPECT_NEAR(spring_arm_length_m(2, 4, 0.4, settings), 3.98, 1e-9) << "and of the way out after 0.4 s";
  EXPECT_LT(spring_arm_length_m(2, 4, 0.1, settings), 3.98);
  EXPECT_NEAR(spring_arm_length_m(5, 1, 1.0 / 60, settings), 1.27, 1e-9);
}

TEST(SpringArm, NoWallStandsBetweenTheTargetsCentreAndTheCamera) {
  Place place(scenes::make_rooms({.duration_s = 12.0}));
  SpringArmPolicy arm(place.site(), place.world());
  const auto world = place.world();
  std::vector<uint32_t> targets;
  for (const Target& target : world->targets()) targets.push_back(*world->mirror().slot_of(target.instance_id));
  std::sort(targets.begin(), targets.end());
  RayFilter walls;
  walls.ignored_slots = targets;
  int pulled_in = 0;
  double wanted = 0;
  for (int k = 0; k <= 720; ++k) {
    const auto step = arm.next(k / 60.0, k == 0 ? 0.0 : 1.0 / 60);
    world->set_time(k / 60.0);
    const glm::dvec3 center = world->targets_center_m(), way = step->camera.position_m - center;
    if (k == 0) wanted = glm::distance(place.scenario.camera().position_m, center);
    pulled_in += glm::length(way) < wanted - 0.5;
    if (glm::length(way) < 1e-6) continue;
    EXPECT_EQ(world->colliders().trace(center, glm::vec3(way), 0.0f, 1.0f, walls).slot, UINT32_MAX) << k;
  }
  EXPECT_GT(pulled_in, 60) << "or the walls were never in the way";
}

// Möller and Trumbore over every triangle, in double.
bool segment_meets(const glm::dvec3& from, const glm::dvec3& to, const Instance& instance) {
  const Geometry& g = *instance.geometry;
  const glm::dvec3 d = to - from;
  for (size_t t = 0; t < g.triangle_count(); ++t) {
    const auto corner = [&](size_t k) {
      return transform_point(instance.world_from_instance, glm::dvec3(g.positions[g.indices[3 * t + k]]));
    };
    const glm::dvec3 a = corner(0), e1 = corner(1) - a, e2 = corner(2) - a, p = glm::cross(d, e2);
    const double det = glm::dot(e1, p);
    if (std::abs(det) < 1e-14) continue;
    const glm::dvec3 s = from - a, q = glm::cross(s, e1);
    const double u = glm::dot(s, p) / det, v = glm::dot(d, q) / det, w = glm::dot(e2, q) / det;
    if (u >= 0 && v >= 0 && u + v <= 1 && w > 0 && w <= 1) return true;
  }
  return false;
}

TEST(Raycast, SeesWhatBruteForceRaysSee) {
  Place place(scenes::make_hall({.duration_s = 4.0}));
  const auto world = place.world();
  std::mt19937_64 random(6);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  int hidden = 0, compared = 0, different = 0;
  for (const double time_s : {0.0, 2.0, 3.7}) {
    world->set_time(time_s);
    CandidateSet candidates;
    for (int i = 0; i < 100; ++i)
      candidates.add(world->targets_center_m() +
                     glm::dvec3(12 * unit(random) - 6, 3 * unit(random) - 0.5, 12 * unit(random) - 6));
    trace_visibility(world->occluders(), world->mirror(), world->targets(), candidates);
    for (size_t i = 0; i < candidates.size(); ++i)
      for (size_t k = 0; k < world->targets().size(); ++k) {
        const uint64_t own = world->targets()[k].instance_id;
        const glm::dvec3 aim = aim_point_m(*world->mirror().find(own));
        bool seen = true;
        for (const Instance& instance : world->mirror().instances())
          if (instance.geometry && instance.occludes() && instance.id != own)
            seen = seen && !segment_meets(aim, candidates.position_m[i], instance);
        ++compared;
        hidden += !seen;
        different += seen != static_cast<bool>(candidates.visible_targets[i] >> k & 1u);
      }
  }
  EXPECT_GT(hidden, compared / 10);
  EXPECT_GT(compared - hidden, compared / 10);
  EXPECT_EQ(different, 0);
}

PolicyEntry policy_named(const std::string& name) {
  for (PolicyEntry& entry : policies())
    if (entry.name == name) return entry;
  throw std::runtime_error("no policy " + name);
}

TEST(Policies, KeepTheMotionLimitsThatTheyPromise) {
  Place place(scenes::make_hall({.duration_s = 4.0}));
  for (const char* name : {"raycast", "paper", "sightline"}) {
    auto policy = policy_named(name).make(place.site());
    ASSERT_TRUE(policy) << name;
    std::vector<CameraFrame> frames;
    for (int k = 0; k <= 180; ++k) {
      const auto step = (*policy)->next(k / 60.0, k == 0 ? 0.0 : 1.0 / 60);
      ASSERT_TRUE(step) << name << ": " << to_string(step.error());
      frames.push_back({k / 60.0, step->camera, step->lens, step->jump});
    }
    for (const MotionSample& sample : motion_of(frames))
      EXPECT_FALSE(sample.valid && breaks_limits(sample, CameraLimits{})) << name;
  }
}

std::vector<std::byte> two_people(bool sealed);

// The steps of a policy in the first second of a scene.
std::vector<PolicyStep> first_second(Place& place, const char* name) {
  auto policy = policy_named(name).make(place.site());
  std::vector<PolicyStep> steps;
  for (int k = 0; k <= 60; ++k) steps.push_back(*(*policy)->next(k / 60.0, k == 0 ? 0.0 : 1.0 / 60));
  return steps;
}

// In the open every policy begins where the scenario's camera stands, keeps its lens, and shows both people in every
// frame.
TEST(Policies, BeginAtTheScenariosCameraAndKeepLookingAtTheTargets) {
  Place place(two_people(false));
  const glm::dvec3 center_m(0, 0, 0);
  for (const char* name : {"follow", "spring-arm", "raycast", "paper", "sightline"}) {
    const std::vector<PolicyStep> steps = first_second(place, name);
    EXPECT_LT(glm::distance(steps[0].camera.position_m, place.scenario.camera().position_m), 0.01) << name;
    EXPECT_LT(angle_between(steps[0].camera.rotation, place.scenario.camera().rotation), 0.05) << name;
    for (const PolicyStep& step : steps) {
      EXPECT_EQ(step.lens.aspect, 1.5) << name;
      EXPECT_NEAR(step.lens.vertical_fov_rad, 0.8, 1e-6) << name;
      const glm::dvec3 way = glm::normalize(center_m - step.camera.position_m);
      EXPECT_GT(glm::dot(step.camera.rotation * glm::dvec3(0, 0, -1), way), std::cos(0.2)) << name;
    }
  }
}

// A person who walks to the side leaves the picture of a camera that does not turn.
TEST(Policies, TurnAfterTargetsThatWalkAway) {
  scenes::GlbWriter writer;
  const int person = writer.add_mesh("person", *tessellate(CapsuleShape{0.3f, 0.6f}), {1, 1, 1});
  const auto role = [](const char* name) { return nlohmann::ordered_json{{"sightline", {{"role", name}}}}; };
  const int walker = writer.add_node({"anna", -1, person, -1, {0, 0, 0}, {1, 0, 0, 0}, role("target")});
  writer.add_node({"eye", -1, -1, writer.add_camera(0.8, 1.5, 0.1), {3, 0, 8}, {1, 0, 0, 0}, role("camera")});
  writer.animate(walker, std::vector<float>{0, 0.5f, 4.5f}, std::vector<glm::vec3>{{0, 0, 0}, {0, 0, 0}, {-16, 0, 0}},
                 std::vector<glm::quat>(3, glm::quat(1, 0, 0, 0)));
  Place place(writer.finish("scenario"));
  const auto world = place.world();
  for (const char* name : {"raycast", "paper", "sightline"}) {
    auto policy = policy_named(name).make(place.site());
    ASSERT_TRUE(policy) << name;
    double apart_m = 0;
    for (int k = 0; k <= 240; ++k) {
      const auto step = (*policy)->next(k / 60.0, k == 0 ? 0.0 : 1.0 / 60);
      ASSERT_TRUE(step) << name;
      world->set_time(k / 60.0);
      const glm::dvec3 way = world->targets_center_m() - step->camera.position_m;
      apart_m = glm::length(way);
      EXPECT_TRUE(k <= 30 || glm::dot(step->camera.rotation * glm::dvec3(0, 0, -1), way / apart_m) > std::cos(0.4))
          << name << " " << k;
    }
    EXPECT_LT(apart_m, 12.0) << name << " follows at 4 m/s";
  }
}

TEST(Policies, ThatChooseAPlaceSayWhereTheyHead) {
  Place place(scenes::make_hall({.duration_s = 4.0}));
  for (const char* name : {"raycast", "paper", "sightline"}) {
    const std::vector<PolicyStep> steps = first_second(place, name);
    for (size_t k = 1; k < steps.size(); ++k) {
      ASSERT_TRUE(steps[k].goal_m) << name << " " << k;
      EXPECT_LT(glm::distance(*steps[k].goal_m, steps[k].camera.position_m), 20.0) << name << " " << k;
    }
  }
  for (const char* name : {"follow", "spring-arm"})
    for (const PolicyStep& step : first_second(place, name)) EXPECT_FALSE(step.goal_m || step.tracking) << name;
}

// Two capsules, each in a closed box when `sealed`, before a camera that looks at them.
std::vector<std::byte> two_people(bool sealed) {
  scenes::GlbWriter writer;
  const int person = writer.add_mesh("person", *tessellate(CapsuleShape{0.3f, 0.6f}), {1, 1, 1});
  const int box = writer.add_mesh("box", *tessellate(BoxShape{{0.8f, 1.5f, 0.8f}}), {1, 1, 1});
  const auto role = [](const char* name) { return nlohmann::ordered_json{{"sightline", {{"role", name}}}}; };
  writer.add_node({"anna", -1, person, -1, {-1, 0, 0}, {1, 0, 0, 0}, role("target")});
  writer.add_node({"ben", -1, person, -1, {1, 0, 0}, {1, 0, 0, 0}, role("target")});
  for (const float x : {-1.0f, 1.0f})
    if (sealed) writer.add_node({x < 0 ? "left" : "right", -1, box, -1, {x, 0, 0}, {1, 0, 0, 0}, {}});
  writer.add_node({"eye", -1, -1, writer.add_camera(0.8, 1.5, 0.1), {0, 0, 8}, {1, 0, 0, 0}, role("camera")});
  return writer.finish("scenario");
}

TEST(Policies, TrackWhomTheySeeAndNobodyInAClosedBox) {
  Place open(two_people(false)), sealed(two_people(true));
  for (const char* name : {"paper", "sightline"}) {
    const auto seen = first_second(open, name), hidden = first_second(sealed, name);
    for (size_t k = 1; k < seen.size(); ++k) {
      EXPECT_EQ(seen[k].tracking, true) << name << " " << k;
      EXPECT_EQ(hidden[k].tracking, false) << name << " " << k;
    }
  }
}

// Anna is the target at first, and from the second second on Ben, 6 m beside her.
TEST(Policies, ShowANewTargetAsTheFormerOne) {
  scenes::GlbWriter writer;
  const int person = writer.add_mesh("person", *tessellate(CapsuleShape{0.3f, 0.6f}), {1, 1, 1});
  const auto target = [](double from_s, double to_s) {
    return nlohmann::ordered_json{{"sightline", {{"role", "target"}, {"during", {{from_s, to_s}}}}}};
  };
  writer.add_node({"anna", -1, person, -1, {0, 0, 0}, {1, 0, 0, 0}, target(0, 2)});
  const int ben = writer.add_node({"ben", -1, person, -1, {6, 0, 0}, {1, 0, 0, 0}, target(2, 9)});
  writer.animate(ben, std::vector<float>{0, 6}, std::vector<glm::vec3>(2, {6, 0, 0}),
                 std::vector<glm::quat>(2, glm::quat(1, 0, 0, 0)));
  writer.add_node({"eye",
                   -1,
                   -1,
                   writer.add_camera(0.8, 1.5, 0.1),
                   {0, 0, 6},
                   {1, 0, 0, 0},
                   {{"sightline", {{"role", "camera"}}}}});
  const std::vector<std::byte> bytes = writer.finish("scenario");
  const SceneCase scene{"two", 1, [bytes](GeometryStore& store) -> Result<Scenario> {
                          return Scenario::from_asset(*read_gltf(bytes, nullptr, store));
                        }};
  const std::vector<PolicyEntry> chosen{policy_named("follow"), policy_named("spring-arm"), policy_named("sightline")};
  const auto runs = evaluate(std::span(&scene, 1), chosen, {.picture_every = 3, .picture_size = 64, .progress = {}});
  ASSERT_TRUE(runs) << to_string(runs.error());
  for (const RunRecord& run : *runs) {
    EXPECT_EQ(run.changes.changes, 1u) << run.policy;
    EXPECT_EQ(run.changes.unanswered, 0u) << run.policy;
    EXPECT_LE(run.changes.longest_answer_s, run.policy == "sightline" ? 2.0 : 0.0) << run.policy;
    EXPECT_EQ(run.metrics.targets.size(), 2u);
    EXPECT_EQ(run.turns.turns, 0u) << "the jump of the centre is no turn of a target";
  }
  EXPECT_GT((*runs)[2].changes.longest_answer_s, 0.1) << "it flies there, within its limits";
  const auto ceiling = evaluate(std::span(&scene, 1), std::vector{policy_named("ceiling-worth")}, EvaluationOptions());
  ASSERT_FALSE(ceiling);
  EXPECT_EQ(ceiling.error().code, ErrorCode::kFailedPrecondition);
}

// They stand 25 m from one another, and the camera begins between them. With these seeds a column hides the one whom it
// sees as it backs off, so that every place near by shows less.
TEST(Policies, ShowThreePeopleWhoStandFarApart) {
  for (const uint64_t seed : {5, 6}) {
    const std::vector<std::byte> bytes = scenes::make_apart({.seed = seed, .people = 3, .apart_m = 25});
    const SceneCase scene{"apart", seed, [bytes](GeometryStore& store) -> Result<Scenario> {
                            return Scenario::from_asset(*read_gltf(bytes, nullptr, store));
                          }};
    const auto runs = evaluate(std::span(&scene, 1), std::vector{policy_named("sightline")},
                               {.picture_every = 60, .picture_size = 128, .progress = {}});
    ASSERT_TRUE(runs) << to_string(runs.error());
    const std::vector<JudgedPicture>& pictures = (*runs)[0].pictures;
    EXPECT_EQ(pictures.front().least_whole_share, 0) << "seed " << seed;
    for (const JudgedPicture& picture : std::span(pictures).last(3))
      EXPECT_GE(picture.least_whole_share, 0.95) << "seed " << seed << " at " << picture.time_s;
  }
}

}  // namespace
}  // namespace sightline
