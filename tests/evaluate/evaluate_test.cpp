// Evaluation: the baselines against brute force, and the files that the command writes.
#include "client/evaluate/evaluate_command.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <random>
#include <set>
#include <sstream>

#include "client/evaluate/evaluation.h"
#include "client/evaluate/evaluation_tables.h"
#include "client/evaluate/policy_raycast.h"
#include "client/evaluate/policy_spring_arm.h"
#include "scenes/catalog.h"
#include "scenes/glb_writer.h"
#include "scenes/hall.h"
#include "scenes/rooms.h"
#include "scenes/subjects.h"
#include "server/paper/paper_settings.h"
#include "server/sample/embree_sampler.h"
#include "server/scene/gltf.h"
#include "server/scene/primitives.h"
#include "server/wire/settings_to_proto.h"
#include "tests/evaluate/table_files.h"
#include "tests/support/temporary_folder.h"

namespace sightline {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using Random = std::mt19937_64;

double unit(Random& random) {
  return std::uniform_real_distribution<double>(0.0, 1.0)(random);
}

// ---- policies ----

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
  Random random(6);
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

// ---- the whole ----

class EvaluateCommand : public testing::Test {
 protected:
  EvaluateOptions short_options(const std::string& name) const {
    EvaluateOptions options;
    options.scenes = {"hall"};
    options.seeds = 2;
    options.duration_s = 1.0;
    options.picture_every = 20;
    options.out = folder_ / name;
    return options;
  }
  const test::TemporaryFolder folder_;
};

TEST_F(EvaluateCommand, WritesTheSameBytesWithOneJobAndWithMany) {
  std::ostringstream out, err;
  EvaluateOptions one = short_options("one"), many = short_options("many");
  one.jobs = 1;
  many.jobs = 3;
  ASSERT_EQ(run_evaluate_command(one, out, err), 0) << err.str();
  ASSERT_EQ(run_evaluate_command(many, out, err), 0) << err.str();
  auto first = files_in(one.out), second = files_in(many.out);
  EXPECT_EQ(first.erase("timing.csv"), 1u);
  EXPECT_EQ(second.erase("timing.csv"), 1u);
  EXPECT_EQ(first.size(), 3u);
  EXPECT_EQ(first, second);
}

TEST(Evaluation, TellsHowFarItIs) {
  const std::vector<PolicyEntry> follow{policy_named("follow")};
  std::vector<double> shares;
  EvaluationOptions options{.rate_hz = 10.0, .duration_s = 0.0, .picture_every = 1, .jobs = 1, .progress = {}};
  options.progress = [&](double share) { shares.push_back(share); };
  auto walk = scenes::make_hall({.duration_s = 2.0});
  const SceneCase hall{"hall", 1,
                       [&](GeometryStore& store) { return Scenario::from_asset(*read_gltf(walk, nullptr, store)); }};
  const auto runs = evaluate(std::vector<SceneCase>{hall}, follow, options);
  ASSERT_TRUE(runs) << to_string(runs.error());
  ASSERT_GE(shares.size(), 2 * 21u) << "while it plays and while it judges";
  EXPECT_TRUE(std::is_sorted(shares.begin(), shares.end()));
  EXPECT_EQ(shares.front(), 0.0);
  EXPECT_LT(shares[20], 0.2) << "playing is the smaller part";
  EXPECT_NEAR(shares.back(), 1.0, 1e-12);
  EXPECT_EQ((*runs)[0].metrics.frames, 21u);
}

TEST_F(EvaluateCommand, WritesARowARunAndARowAPicture) {
  std::ostringstream out, err;
  EvaluateOptions options = short_options("tables");
  options.policies = {"sightline", "follow"};
  ASSERT_EQ(run_evaluate_command(options, out, err), 0) << err.str();
  const auto files = files_in(options.out);
  const auto runs = columns_of(files.at("runs.csv")), pictures = columns_of(files.at("pictures.csv"));
  EXPECT_THAT(runs.at("policy"), ElementsAre("\"follow\"", "\"sightline\"", "\"follow\"", "\"sightline\""));
  EXPECT_THAT(runs.at("seed"), ElementsAre("1", "1", "2", "2"));
  EXPECT_THAT(runs.at("frames"), ElementsAre("61", "61", "61", "61"));
  EXPECT_THAT(runs.at("pictures"), ElementsAre("4", "4", "4", "4"));
  EXPECT_EQ(runs.at("reported_pairs")[0], "") << "follow reports nothing";
  EXPECT_EQ(runs.at("reported_pairs")[1], "8") << "two targets in four pictures";
  EXPECT_EQ(runs.at("pair_volume_share")[1], "0") << "the default uses the lattice";
  for (const char* column : {"goal_jumps_per_s", "pair_volume_share", "tracking_while_lost", "lost_called_tracking",
                             "tracking_while_half_hidden"}) {
    EXPECT_EQ(runs.at(column)[0], "") << "follow has neither a goal nor a status";
    EXPECT_NE(runs.at(column)[1], "") << column;
  }
  ASSERT_EQ(pictures.at("time_s").size(), 16u);
  EXPECT_EQ(pictures.at("time_s")[3], "1");
  EXPECT_EQ(pictures.at("lost")[3], "0");
  EXPECT_EQ(pictures.at("tracking")[3], "") << "follow has no status";
  EXPECT_EQ(pictures.at("tracking")[7], "1");
  EXPECT_THAT(files.at("timing.csv"), HasSubstr("scene,seed,targets,policy,run_s,step_ms"));
  EXPECT_THAT(out.str(), HasSubstr("sightline"));
}

TEST_F(EvaluateCommand, DrawsASheetOfEachRun) {
  std::ostringstream out, err;
  EvaluateOptions options = short_options("sheets");
  options.policies = {"sightline", "follow"};
  ASSERT_EQ(run_evaluate_command(options, out, err), 0) << err.str();
  EXPECT_FALSE(files_in(options.out).contains("sheets/hall-1-follow.jpg")) << "only if asked for";
  options.sheets = true;
  ASSERT_EQ(run_evaluate_command(options, out, err), 0) << err.str();
  const auto files = files_in(options.out);
  std::set<std::string> sheets;
  for (const std::string name : {"hall-1-follow", "hall-1-sightline", "hall-2-follow", "hall-2-sightline"}) {
    const std::string& bytes = files.at("sheets/" + name + ".jpg");
    EXPECT_EQ(bytes.substr(0, 3), "\xff\xd8\xff") << "a JPEG file";
    sheets.insert(bytes);
  }
  EXPECT_EQ(sheets.size(), 4u) << "no two runs look alike";
}

TEST_F(EvaluateCommand, WritesWhatTheReasonsSay) {
  std::ostringstream out, err;
  EvaluateOptions options = short_options("reasons");
  options.policies = {"sightline", "follow"};
  ASSERT_EQ(run_evaluate_command(options, out, err), 0) << err.str();
  const auto rows = columns_of(files_in(options.out).at("reasons.csv"));
  ASSERT_FALSE(rows.at("policy").empty());
  for (const std::string& policy : rows.at("policy")) EXPECT_EQ(policy, "\"sightline\"") << "follow gives no reasons";
  int claims = 0;
  for (const std::string& count : rows.at("claims")) claims += std::stoi(count);
  EXPECT_GE(claims, 4) << "a picture every 20 frames, of two runs";
}

TEST_F(EvaluateCommand, TellsTheShareOfPairVolumesWithEitherSampler) {
  for (const std::string sampler : {"embree", "egl"}) {
    std::ostringstream out, err;
    EvaluateOptions options = short_options("pairs-" + sampler);
    options.policies = {"paper"};
    options.sampler = sampler;
    const int status = run_evaluate_command(options, out, err);
    if (status != 0 && sampler == "egl" && !std::getenv("SIGHTLINE_REQUIRE_EGL")) GTEST_SKIP() << err.str();
    ASSERT_EQ(status, 0) << err.str();
    EXPECT_THAT(columns_of(files_in(options.out).at("runs.csv")).at("pair_volume_share"), ElementsAre("1", "1"))
        << sampler;
  }
}

TEST_F(EvaluateCommand, PlaysTheCeilingOnlyWhenAsked) {
  std::ostringstream out, err;
  EvaluateOptions options = short_options("default");
  options.seeds = 1;
  options.duration_s = 0.2;
  ASSERT_EQ(run_evaluate_command(options, out, err), 0) << err.str();
  const auto runs = columns_of(files_in(options.out).at("runs.csv"));
  EXPECT_THAT(runs.at("policy"),
              ElementsAre("\"follow\"", "\"spring-arm\"", "\"raycast\"", "\"paper\"", "\"sightline\""));
  EXPECT_THAT(runs.at("most_joint"), ElementsAre("", "", "", "", ""));
  EXPECT_THAT(out.str(), Not(HasSubstr("100.0 %"))) << "no ceiling, no share of it";
}

// At its start the hall hides nothing, so the ceiling sees all, and the default's share of it is its own joint share.
TEST_F(EvaluateCommand, ShowsTheShareOfTheCeiling) {
  std::ostringstream out, err;
  EvaluateOptions options = short_options("ceiling");
  options.seeds = 1;
  options.duration_s = 0.4;
  options.picture_every = 6;
  options.policies = {"sightline", "ceiling"};
  ASSERT_EQ(run_evaluate_command(options, out, err), 0) << err.str();
  const auto runs = columns_of(files_in(options.out).at("runs.csv"));
  EXPECT_THAT(runs.at("policy"), ElementsAre("\"sightline\"", "\"ceiling\""));
  EXPECT_THAT(runs.at("joint_visible_share"), ElementsAre("1", "1"));
  EXPECT_THAT(runs.at("most_joint"), ElementsAre("", "1"));
  EXPECT_THAT(runs.at("limit_violations"), ElementsAre("0", "0"));
  EXPECT_THAT(out.str(), HasSubstr("100.0 %"));
}

TEST_F(EvaluateCommand, SaysWhatItCannotFind) {
  std::ostringstream out, err;
  EvaluateOptions options = short_options("nothing");
  options.scenes = {"no-such-scene"};
  EXPECT_EQ(run_evaluate_command(options, out, err), 1);
  EXPECT_THAT(err.str(), HasSubstr("no-such-scene"));
  options = short_options("nothing");
  options.policies = {"teleport"};
  EXPECT_EQ(run_evaluate_command(options, out, err), 1);
  EXPECT_THAT(err.str(), HasSubstr("teleport"));
}

// A filter that equals the preset's gives the preset's settings; another strategy does not.
TEST_F(EvaluateCommand, PlaysSettingsOfOnesOwnAsPolicies) {
  std::ostringstream out, err;
  EvaluateOptions options = short_options("own");
  options.policies = {"sightline"};
  options.settings = {R"(same={"settings":{"preset":"PRESET_SIGHTLINE"}})",
                      R"(basic={"settings":{"prediction_s":0},"tuning":{"move":{"strategy":"STRATEGY_BASIC"}}})"};
  ASSERT_EQ(run_evaluate_command(options, out, err), 0) << err.str();
  const auto runs = columns_of(files_in(options.out).at("runs.csv"));
  EXPECT_THAT(std::span(runs.at("policy")).first(3), ElementsAre("\"sightline\"", "\"same\"", "\"basic\""));
  const auto& path_m = runs.at("d_c_m");
  EXPECT_EQ(path_m[1], path_m[0]);
  EXPECT_NE(path_m[2], path_m[0]);
}

TEST_F(EvaluateCommand, SaysWhichSettingIsWrong) {
  const std::pair<const char*, const char*> cases[] = {
      {"nothing", "settings"},
      {"a b={}", "settings"},
      {"x={", "settings.x"},
      {R"(x={"tuning":{"move":{"speed":1}}})", "settings.x"},
      {R"(x={"label":"y"})", "settings.x"},
      {R"(x={"settings":{"prediction_s":3}})", "settings.x.settings.prediction_s"},
      {R"(x={"tuning":{"aggregate":{"filter":{"alpha":1.5}}}})", "settings.x.tuning.aggregate.filter.alpha"},
      {"sightline={}", "settings"}};
  for (const auto& [text, field] : cases) {
    EvaluateOptions options = short_options("wrong");
    options.settings = {text};
    std::ostringstream out, err;
    EXPECT_EQ(run_evaluate_command(options, out, err), 1) << text;
    EXPECT_THAT(err.str(), HasSubstr(std::string(field).append(":"))) << text;
  }
}

TEST(EvaluateCases, WithoutNamesAreEverySceneOfTheStudyAtEverySeed) {
  EvaluateOptions options;
  options.seeds = 2;
  const auto cases = cases_of(options);
  ASSERT_TRUE(cases);
  std::map<std::string, int> seeds_of;
  for (const SceneCase& scene : *cases) ++seeds_of[scene.name];
  EXPECT_EQ(seeds_of.at("hall"), 2);
  std::vector<std::string> sized;
  for (const auto& [name, seeds] : seeds_of) {
    EXPECT_EQ(seeds, 2) << name;
    if (name.starts_with("arena") || name.starts_with("crowd")) sized.push_back(name);
  }
  EXPECT_THAT(sized, ElementsAre("arena-2", "arena-3", "arena-4", "arena-5", "arena-6", "arena-7", "arena-8", "crowd-0",
                                 "crowd-10", "crowd-20", "crowd-35"));
  GeometryStore store;
  for (const SceneCase& scene : *cases) {
    if (scene.name != "arena-7") continue;
    EXPECT_EQ(scene.load(store)->targets().size(), 7u);
  }
}

TEST(EvaluateCases, OfAGroupAreItsScenesFromTheFirstSeedOn) {
  EvaluateOptions options;
  options.groups = {"levels"};
  options.seeds = 2;
  options.first_seed = 101;
  const auto cases = cases_of(options);
  ASSERT_TRUE(cases);
  ASSERT_EQ(cases->size(), 2 * scenes::scenes_of(scenes::SceneGroup::kLevels).size());
  EXPECT_EQ((*cases)[0].name, "level-rooms-one");
  EXPECT_EQ((*cases)[0].seed, 101u);
  EXPECT_EQ((*cases)[1].seed, 102u);
  GeometryStore store;
  const auto scenario = (*cases)[1].load(store);
  ASSERT_TRUE(scenario);
  EXPECT_NE(scenario->asset().hash, (*cases)[0].load(store)->asset().hash) << "another seed, another level";
}

TEST(EvaluateCases, SayWhichGroupOrFolderIsMissing) {
  EvaluateOptions options;
  options.groups = {"no-such-group"};
  ASSERT_FALSE(cases_of(options));
  EXPECT_EQ(cases_of(options).error().field, "group");
  options.groups = {"tiles"};
  options.tiles = "no-such-folder";
  ASSERT_FALSE(cases_of(options));
  EXPECT_EQ(cases_of(options).error().field, "tiles");
}

// Every line of the settings file, by name.
std::map<std::string, std::string> paper_settings() {
  std::ifstream file(PAPER_SETTINGS);
  std::map<std::string, std::string> settings;
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with('#')) continue;
    const auto named = read_named_settings(line);
    if (!named) throw std::runtime_error(to_string(named.error()));
    settings[named->name] = settings_to_proto(named->settings).SerializeAsString();
  }
  return settings;
}

TEST(PaperSettings, AreTheRowsOfThePapersTables) {
  std::map<std::string, std::string> rows;
  const auto add = [&](const std::string& name, const StepSettings& settings) {
    rows[name] = settings_to_proto(settings).SerializeAsString();
  };
  for (const auto& [name, strategy] : {std::pair("basic", Strategy::kBasic), std::pair("robust", Strategy::kRobust)}) {
    add(name, paper_row(strategy, 0.0));
    for (const int ms : {100, 300, 500})
      add(std::string(name).append("-").append(std::to_string(ms)), paper_row(strategy, 0.001 * ms));
  }
  add("center", center_row(0.0));
  for (const int ms : {100, 300, 500}) add("center-" + std::to_string(ms), center_row(0.001 * ms));
  for (const auto& [a, n] : {std::pair(0, 0), std::pair(3, 5), std::pair(6, 10), std::pair(8, 15)}) {
    const std::string window = std::to_string(a) + "-" + std::to_string(n);
    add("stability-" + window, paper_stability(a, n));
    add("agile-" + window, agile_stability(a, n));
  }
  EXPECT_EQ(paper_settings(), rows);
}

TEST(PaperSettings, AreThePaperPresetWithOnePartChanged) {
  const StepSettings paper = preset_settings(Preset::kPaper), row = paper_row(Strategy::kBasic, 0.1);
  EXPECT_EQ(row.aggregate.filter.mode, FilterMode::kNone);
  EXPECT_EQ(row.move.strategy, Strategy::kBasic);
  EXPECT_EQ(row.move.prediction_s, 0.1);
  EXPECT_EQ(row.bound.mode, paper.bound.mode);
  EXPECT_EQ(row.aggregate.volume, paper.aggregate.volume);
  EXPECT_EQ(row.sample.points, paper.sample.points);
  EXPECT_EQ(row.sample.jitter, paper.sample.jitter);
  const FilterSettings filter = paper_stability(3, 5).aggregate.filter;
  EXPECT_EQ(filter.mode, FilterMode::kJoint);
  EXPECT_EQ(filter.alpha, 0.6);
  EXPECT_EQ(filter.n, 5);
  EXPECT_EQ(paper_stability(8, 15).move.strategy, Strategy::kBasic);
}

TEST(ExactText, ReadsBackAsTheSameDouble) {
  Random random(7);
  for (int i = 0; i < 1000; ++i) {
    const double value = (unit(random) - 0.5) * std::pow(10.0, 40 * (unit(random) - 0.5));
    EXPECT_EQ(std::stod(exact_text(value)), value);
  }
  EXPECT_EQ(exact_text(0.1), "0.1");
}

}  // namespace
}  // namespace sightline
