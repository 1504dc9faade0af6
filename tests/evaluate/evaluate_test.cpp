// Evaluation: the figures against plain reimplementations on random traces, the baselines against brute
// force, and the files against each other.
#include "client/evaluate/evaluate_command.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <random>
#include <sstream>

#include "client/evaluate/evaluation_tables.h"
#include "client/evaluate/plot.h"
#include "client/evaluate/policy_raycast.h"
#include "client/evaluate/policy_spring_arm.h"
#include "scenes/glb_writer.h"
#include "scenes/hall.h"
#include "scenes/rooms.h"
#include "server/sample/embree_sampler.h"
#include "server/scene/gltf.h"
#include "server/scene/primitives.h"
#include "tests/evaluate/table_files.h"
#include "tests/support/temporary_folder.h"

namespace sightline {
namespace {

using ::testing::HasSubstr;
using Random = std::mt19937_64;

double unit(Random& random) {
  return std::uniform_real_distribution<double>(0.0, 1.0)(random);
}

// ---- figures ----

// Pictures at steps of 0.1 s whose share is often 0, often 1 and sometimes between.
std::vector<SightSample> random_sights(Random& random, size_t count) {
  std::vector<SightSample> samples;
  double share = 1.0;
  for (size_t i = 0; i < count; ++i) {
    if (unit(random) < 0.3) {
      const double draw = unit(random);
      share = draw < 0.4 ? 0.0 : draw < 0.7 ? 1.0 : unit(random);
    }
    samples.push_back({0.1 * static_cast<double>(i), share});
  }
  return samples;
}

// Every index asked on its own, with no state carried along.
struct PlainEpisodes {
  std::vector<double> lengths, reacquired;
  size_t open = 0;

  void add(const std::vector<SightSample>& s) {
    for (size_t i = 0; i < s.size(); ++i) {
      const bool starts = s[i].visible_share == 0.0 && (i == 0 || s[i - 1].visible_share > 0.0);
      if (!starts) continue;
      double until = s.back().time_s, clear = s.back().time_s;
      bool found = false;
      for (size_t j = s.size(); j-- > i;) {
        if (s[j].visible_share > 0.0) until = s[j].time_s;
        if (s[j].visible_share >= 0.95) clear = s[j].time_s, found = true;
      }
      lengths.push_back(until - s[i].time_s);
      reacquired.push_back(clear - s[i].time_s);
      open += !found;
    }
  }
};

TEST(Episodes, EqualAPlainCountOnRandomTraces) {
  Random random(1);
  for (int round = 0; round < 200; ++round) {
    const std::vector<std::vector<SightSample>> targets{random_sights(random, 1 + round),
                                                        random_sights(random, 60)};
    PlainEpisodes plain;
    for (const auto& samples : targets) plain.add(samples);
    const EpisodeMetrics metrics = episodes_of(targets);
    ASSERT_EQ(metrics.count, plain.lengths.size());
    ASSERT_EQ(metrics.never_reacquired, plain.open);
    if (plain.lengths.empty()) continue;
    std::sort(plain.lengths.begin(), plain.lengths.end());
    const auto rank = static_cast<size_t>(std::ceil(0.95 * static_cast<double>(plain.lengths.size())));
    EXPECT_DOUBLE_EQ(metrics.p95_length_s, plain.lengths[rank - 1]);
    double sum = 0;
    for (const double t : plain.reacquired) sum += t;
    EXPECT_NEAR(metrics.mean_reacquire_s, sum / static_cast<double>(plain.reacquired.size()), 1e-9);
  }
}

TEST(Episodes, NoneWithoutSamplesOrLosses) {
  EXPECT_EQ(episodes_of({}).count, 0u);
  const std::vector<std::vector<SightSample>> seen{{}, {{0.0, 1.0}, {0.1, 0.01}}};
  EXPECT_EQ(episodes_of(seen).count, 0u);
}

struct Trace {
  std::vector<CameraFrame> frames;
  std::vector<FrameTruth> truths;
};

// A camera that mostly walks, sometimes leaps or spins, and sometimes declares it; centres that come and go.
Trace random_trace(Random& random, size_t count) {
  Trace trace;
  glm::dvec3 at(0.0);
  double yaw = 0;
  for (size_t i = 0; i < count; ++i) {
    CameraFrame frame;
    frame.time_s = static_cast<double>(i) / 60;
    frame.jump = unit(random) < 0.1;
    const double reach = unit(random) < 0.1 ? 2.0 : 0.3;
    at += reach * glm::dvec3(unit(random) - 0.5, unit(random) - 0.5, unit(random) - 0.5);
    yaw += (unit(random) < 0.1 ? 0.4 : 0.04) * (unit(random) - 0.5);
    frame.camera = {at, glm::angleAxis(yaw, glm::dvec3(0, 1, 0))};
    trace.frames.push_back(frame);
    FrameTruth truth;
    for (int k = 0; k < 3; ++k) {
      truth.centers.emplace_back();
      if (unit(random) < 0.8) truth.centers.back() = glm::dvec2(unit(random) - 0.5, unit(random) - 0.5);
    }
    trace.truths.push_back(truth);
  }
  return trace;
}

Scenario any_scenario(GeometryStore& store) {
  return *Scenario::from_asset(*read_gltf(scenes::make_hall({.duration_s = 2.0}), nullptr, store));
}

TEST(Travel, PopsAndScreenTravelEqualAPlainCountOnRandomTraces) {
  GeometryStore store;
  const Scenario scenario = any_scenario(store);
  Random random(2);
  for (int round = 0; round < 20; ++round) {
    const Trace trace = random_trace(random, 200);
    const RunMetrics metrics = summarize(scenario, trace.frames, trace.truths, CameraLimits{});
    double d_c = 0, d_s = 0;
    size_t pops = 0;
    for (size_t i = 1; i < 200; ++i) {
      const Pose &a = trace.frames[i - 1].camera, &b = trace.frames[i].camera;
      if (trace.frames[i].jump) continue;
      const double moved = std::sqrt(std::pow(b.position_m.x - a.position_m.x, 2) +
                                     std::pow(b.position_m.y - a.position_m.y, 2) +
                                     std::pow(b.position_m.z - a.position_m.z, 2));
      const glm::dvec3 fa = a.rotation * glm::dvec3(0, 0, -1), fb = b.rotation * glm::dvec3(0, 0, -1);
      const double turned = std::acos(std::min(1.0, fa.x * fb.x + fa.y * fb.y + fa.z * fb.z));
      d_c += moved;
      pops += moved > 0.5 || turned * 180 / 3.14159265358979 > 5.0;
      for (size_t k = 0; k < 3; ++k) {
        const auto &p = trace.truths[i - 1].centers[k], &q = trace.truths[i].centers[k];
        if (p.has_value() && q.has_value()) d_s += std::hypot(p->x - q->x, p->y - q->y);
      }
    }
    EXPECT_EQ(metrics.pops, pops);
    EXPECT_GT(pops, 0u);
    EXPECT_NEAR(metrics.d_c_m, d_c, 1e-9);
    EXPECT_NEAR(metrics.d_s_heights, d_s, 1e-9);
  }
}

TEST(Motion, JerkIsTheThirdDifferenceOfThePlaces) {
  Random random(3);
  std::vector<CameraFrame> frames = random_trace(random, 60).frames;
  for (CameraFrame& frame : frames) frame.jump = false;
  const auto samples = motion_of(frames);
  const double dt = 1.0 / 60;
  double squares = 0;
  for (size_t i = 3; i < frames.size(); ++i) {
    const auto p = [&](size_t back) { return frames[i - back].camera.position_m; };
    const double jerk = glm::length(p(0) - 3.0 * p(1) + 3.0 * p(2) - p(3)) / (dt * dt * dt);
    ASSERT_TRUE(samples[i].has_jerk);
    EXPECT_NEAR(samples[i].jerk_mps3, jerk, 1e-6 * jerk);
    squares += jerk * jerk;
  }
  for (size_t i = 1; i < 3; ++i) squares += samples[i].jerk_mps3 * samples[i].jerk_mps3;
  GeometryStore store;
  const RunMetrics metrics =
      summarize(any_scenario(store), frames, std::vector<FrameTruth>(frames.size()), CameraLimits{});
  EXPECT_NEAR(metrics.rms_jerk_mps3, std::sqrt(squares / 59), 1e-6 * metrics.rms_jerk_mps3);
}

TEST(Motion, AJumpLeavesNoJerkForThreeFrames) {
  Random random(4);
  std::vector<CameraFrame> frames = random_trace(random, 12).frames;
  for (CameraFrame& frame : frames) frame.jump = false;
  frames[6].jump = true;
  const auto samples = motion_of(frames);
  for (size_t i = 1; i < 12; ++i) EXPECT_EQ(samples[i].has_jerk, i < 6 || i > 8) << i;
}

TEST(Words, EqualAPlainCountOnRandomShares) {
  Random random(5);
  std::vector<FrameTruth> truths;
  std::vector<std::vector<ReportedShare>> words;
  struct Sums {
    double error = 0, false_visible = 0, false_occluded = 0;
  };
  Sums step = {}, filtered = {};
  double pairs = 0, hidden = 0;
  const auto add = [](Sums& sums, double share, double true_share) {
    sums.error += std::abs(share - true_share);
    sums.false_visible += true_share < 0.5 && share >= 0.5;
    sums.false_occluded += true_share >= 0.5 && share < 0.5;
  };
  for (int i = 0; i < 500; ++i) {
    FrameTruth& truth = truths.emplace_back();
    std::vector<ReportedShare>& said = words.emplace_back();
    if (i % 3 == 0) truth.picture.emplace();
    for (uint64_t id = 1; id <= 2; ++id) {
      const auto alone = static_cast<uint32_t>(unit(random) < 0.2 ? 0 : 100);
      const auto visible = static_cast<uint32_t>(alone * unit(random));
      const double share = unit(random), filtered_share = unit(random) * unit(random);
      said.insert(said.begin(), {id, share, filtered_share});  // not in the truth's order
      if (!truth.picture) continue;
      truth.picture->targets.push_back({id, alone, visible, true});
      if (alone == 0) continue;
      const double true_share = visible / 100.0;
      pairs += 1, hidden += true_share < 0.5;
      add(step, share, true_share);
      add(filtered, filtered_share, true_share);
    }
  }
  const ReportMetrics metrics = judge_reports(truths, words);
  EXPECT_EQ(static_cast<double>(metrics.pairs), pairs);
  EXPECT_EQ(static_cast<double>(metrics.hidden_pairs), hidden);
  for (const auto& [got, sums] : {std::pair(metrics.visible, step), std::pair(metrics.filtered, filtered)}) {
    EXPECT_NEAR(got.mean_absolute_error, sums.error / pairs, 1e-9);
    EXPECT_NEAR(got.false_visible, sums.false_visible / hidden, 1e-9);
    EXPECT_NEAR(got.false_occluded, sums.false_occluded / (pairs - hidden), 1e-9);
  }
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
  for (const Target& target : world->targets())
    targets.push_back(*world->mirror().slot_of(target.instance_id));
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
    cast_visibility(world->occluders(), world->mirror(), world->targets(), candidates);
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

TEST(Policies, KeepTheMotionLimitsThatTheyPromise) {
  Place place(scenes::make_hall({.duration_s = 4.0}));
  for (const char* name : {"raycast", "paper", "sightline"}) {
    auto policy = find_policy(name)->make(place.site());
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

// ---- reaction ----

// Two people at rest; a wall that stands between them and the camera from 1 s to `until_s`.
std::vector<std::byte> sudden_wall(float until_s) {
  scenes::GlbWriter writer;
  const int person = writer.add_mesh("person", *tessellate(CapsuleShape{0.3f, 0.6f}), {1, 1, 1});
  const int wall = writer.add_mesh("wall", *tessellate(BoxShape{{4, 4, 0.1f}}), {1, 1, 1});
  const auto role = [](const char* name) { return nlohmann::ordered_json{{"sightline", {{"role", name}}}}; };
  writer.add_node({"anna", -1, person, -1, {-1, 0, 0}, {1, 0, 0, 0}, role("target")});
  writer.add_node({"ben", -1, person, -1, {1, 0, 0}, {1, 0, 0, 0}, role("target")});
  const int slide = writer.add_node({"slide", -1, wall, -1, {20, 0, 4}, {1, 0, 0, 0}, role("occluder")});
  writer.add_node({"eye", -1, -1, writer.add_camera(0.8, 1.5, 0.1), {0, 0, 8}, {1, 0, 0, 0}, role("camera")});
  const glm::quat still(1, 0, 0, 0);
  const glm::vec3 away(20, 0, 4), between(0, 0, 4);
  writer.animate(slide, std::vector<float>{0, 0.999f, 1, until_s, until_s + 0.001f, 5},
                 std::vector<glm::vec3>{away, away, between, between, away, away},
                 std::vector<glm::quat>(6, still));
  return writer.finish("scenario");
}

// At rest, and from `answer_tick` on upwards at 0.6 m/s.
std::vector<CameraFrame> answering_path(const Scenario& scenario, int answer_tick) {
  std::vector<CameraFrame> frames;
  for (int k = 0; k <= 270; ++k) {
    frames.push_back({k / 60.0, scenario.camera(), scenario.lens(), false});
    if (k >= answer_tick) frames.back().camera.position_m.y += 0.01 * (k - answer_tick + 1);
  }
  return frames;
}

TEST(Reaction, IsTheTimeUntilTheCameraLeavesItsCourse) {
  Place place(sudden_wall(4.0f));
  const auto world = place.world();
  for (const int delay_ticks : {1, 7, 60}) {
    const auto frames = answering_path(place.scenario, 60 + delay_ticks);
    const ReactionMetrics metrics = measure_reaction(*world, frames);
    EXPECT_EQ(metrics.occlusions, 2u) << "one a target";
    EXPECT_NEAR(metrics.mean_delay_s, delay_ticks / 60.0, 1e-9);
    EXPECT_EQ(metrics.unanswered, 0u);
  }
}

TEST(Reaction, ACameraThatNeverMovesIsCountedWithTheLongestDelay) {
  Place place(sudden_wall(4.0f));
  const ReactionMetrics metrics = measure_reaction(*place.world(), answering_path(place.scenario, 1000));
  EXPECT_EQ(metrics.unanswered, 2u);
  EXPECT_NEAR(metrics.mean_delay_s, kLongestReactionS, 1e-9);
  EXPECT_NEAR(metrics.mean_regain_s, 3.0, 2.0 / 60) << "when the wall goes by itself";
}

TEST(Reaction, AMomentaryOcclusionIsPassedOver) {
  Place place(sudden_wall(1.4f));
  const ReactionMetrics metrics = measure_reaction(*place.world(), answering_path(place.scenario, 1000));
  EXPECT_EQ(metrics.occlusions, 0u);
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
  EXPECT_GT(first.size(), 20u);
  EXPECT_EQ(first, second);
}

TEST_F(EvaluateCommand, CsvAndJsonHoldARowARunAndAgree) {
  std::ostringstream out, err;
  const EvaluateOptions options = short_options("tables");
  ASSERT_EQ(run_evaluate_command(options, out, err), 0) << err.str();
  const auto files = files_in(options.out);
  std::stringstream csv(files.at("runs.csv"));
  std::string line;
  std::getline(csv, line);
  const std::vector<std::string> head = split(line);
  const auto json = nlohmann::json::parse(files.at("runs.json"));
  ASSERT_EQ(json.size(), 2 * policies().size());
  for (const auto& row : json) {
    ASSERT_TRUE(std::getline(csv, line));
    const std::vector<std::string> cells = split(line);
    ASSERT_EQ(cells.size(), head.size());
    for (size_t i = 0; i < head.size(); ++i) {
      const auto& value = row.at(head[i]);
      if (value.is_null())
        EXPECT_EQ(cells[i], "") << head[i];
      else if (value.is_string())
        EXPECT_EQ(cells[i], '"' + value.get<std::string>() + '"');
      else
        EXPECT_EQ(std::stod(cells[i]), value.get<double>()) << head[i];
    }
  }
  EXPECT_FALSE(std::getline(csv, line));
  EXPECT_THAT(files.at("summary.md"), HasSubstr("| hall | sightline | 2 |"));
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

// A filter as the preset has it is the preset; another strategy is not.
TEST_F(EvaluateCommand, PlaysSettingsOfOnesOwnAsPolicies) {
  std::ostringstream out, err;
  EvaluateOptions options = short_options("own");
  options.policies = {"sightline"};
  options.settings = {R"(same={"preset":"SIGHTLINE"})", R"(basic={"move":{"strategy":"BASIC","prediction_s":0}})"};
  ASSERT_EQ(run_evaluate_command(options, out, err), 0) << err.str();
  std::map<std::string, double> path_by_policy;
  for (const auto& row : nlohmann::json::parse(files_in(options.out).at("runs.json")))
    path_by_policy[row.at("policy")] += row.at("d_c_m").get<double>();
  ASSERT_EQ(path_by_policy.size(), 3u);
  EXPECT_EQ(path_by_policy["same"], path_by_policy["sightline"]);
  EXPECT_NE(path_by_policy["basic"], path_by_policy["sightline"]);
}

TEST_F(EvaluateCommand, SaysWhichSettingIsWrong) {
  const std::pair<const char*, const char*> cases[] = {
      {"nothing", "settings"},
      {"a b={}", "settings"},
      {"x={", "settings.x"},
      {R"(x={"move":{"speed":1}})", "settings.x"},
      {R"(x={"move":{"prediction_s":3}})", "settings.x.move.prediction_s"},
      {R"(x={"aggregate":{"filter":{"alpha":1.5}}})", "settings.x.aggregate.filter.alpha"},
      {"sightline={}", "settings"}};
  for (const auto& [text, field] : cases) {
    EvaluateOptions options = short_options("wrong");
    options.settings = {text};
    std::ostringstream out, err;
    EXPECT_EQ(run_evaluate_command(options, out, err), 1) << text;
    EXPECT_THAT(err.str(), HasSubstr(std::string(field).append(":"))) << text;
  }
}

TEST(EvaluateCases, TheSuiteHoldsEverySceneAtEverySeed) {
  EvaluateOptions options;
  options.suite = "scenes";
  options.seeds = 2;
  const auto cases = cases_of(options);
  ASSERT_TRUE(cases);
  std::map<std::string, int> seeds_of;
  for (const SceneCase& scene : *cases) ++seeds_of[scene.name];
  EXPECT_EQ(seeds_of.at("hall"), 2);
  EXPECT_EQ(seeds_of.at("arena-2"), 2);
  EXPECT_EQ(seeds_of.at("arena-8"), 2);
  EXPECT_FALSE(seeds_of.contains("arena"));
  EXPECT_EQ(seeds_of.at("crowd-35"), 2);
  GeometryStore store;
  for (const SceneCase& scene : *cases) {
    if (scene.name != "arena-7") continue;
    EXPECT_EQ(scene.load(store)->targets().size(), 7u);
  }
}

TEST(FloorPlan, CutsABoxIntoItsOutline) {
  SceneMirror mirror;
  GeometryStore store;
  SceneDelta delta;
  delta.add.push_back({1,
                       *store.intern(*tessellate(BoxShape{{2, 1, 3}})),
                       Pose{{5, 0, 7}, {1, 0, 0, 0}},
                       glm::dmat3(1.0),
                       {}});
  ASSERT_TRUE(mirror.apply(delta, {}));
  double length = 0;
  for (const PlanSegment& piece : cut_level(mirror, 0.25, false, {}))
    length += glm::distance(piece.from_m, piece.to_m);
  EXPECT_NEAR(length, 20, 1e-5) << "twice four and twice six metres";
  EXPECT_TRUE(cut_level(mirror, 1.5, false, {}).empty());
  EXPECT_TRUE(cut_level(mirror, 0.25, true, {}).empty());
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
