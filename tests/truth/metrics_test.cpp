// Figures of a run against cases worked out by hand.
#include "client/truth/metrics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "client/truth/follow.h"
#include "scenes/glb_writer.h"
#include "server/scene/gltf.h"
#include "server/scene/primitives.h"

namespace sightline {
namespace {

constexpr double kDt = 0.1;

CameraFrame at(int k, const glm::dvec3& position, double yaw_rad = 0, double pitch_rad = 0) {
  CameraFrame frame;
  frame.time_s = k * kDt;
  frame.camera = {position,
                  glm::angleAxis(yaw_rad, glm::dvec3(0, 1, 0)) * glm::angleAxis(pitch_rad, glm::dvec3(1, 0, 0))};
  return frame;
}

TEST(Motion, UniformSpeedHasNoAccelerationAfterTheFirstStep) {
  std::vector<CameraFrame> frames;
  for (int k = 0; k < 5; ++k) frames.push_back(at(k, {0.3 * k, 0, 0}));
  const auto samples = motion_of(frames);
  EXPECT_FALSE(samples[0].valid);
  EXPECT_NEAR(samples[1].speed_mps, 3, 1e-9);
  EXPECT_NEAR(samples[1].acceleration_mps2, 30, 1e-9) << "from rest";
  EXPECT_NEAR(samples[4].acceleration_mps2, 0, 1e-9);
}

TEST(Motion, ATurnAcrossTheBackIsNoJump) {
  const auto samples = motion_of(std::vector{at(0, {}, 3.1), at(1, {}, 3.2), at(2, {}, 3.3)});
  EXPECT_NEAR(samples[1].angular_speed_radps, 1.0, 1e-9);
  EXPECT_NEAR(samples[2].angular_speed_radps, 1.0, 1e-9);
  EXPECT_NEAR(samples[2].angular_acceleration_radps2, 0.0, 1e-8);
}

TEST(Motion, YawIsDefinedStraightDown) {
  const double down = -std::numbers::pi / 2;
  const auto samples = motion_of(std::vector{at(0, {}, 0, down), at(1, {}, 0.2, down), at(2, {}, 0.4, down)});
  EXPECT_NEAR(samples[2].angular_speed_radps, 2.0, 1e-6);
  EXPECT_NEAR(samples[2].angular_acceleration_radps2, 0.0, 1e-5);
}

TEST(Motion, YawAndPitchAreOneVector) {
  const auto samples = motion_of(std::vector{at(0, {}), at(1, {}, 0.3, 0.4), at(2, {}, 0.6, 0.8)});
  EXPECT_NEAR(samples[2].angular_speed_radps, 5.0, 1e-9);
}

TEST(Motion, AJumpAndTheStepAfterItAreNotJudged) {
  std::vector<CameraFrame> frames;
  for (int k = 0; k < 6; ++k) frames.push_back(at(k, {k < 3 ? 0.0 : 50.0, 0, 0}));
  frames[3].jump = true;
  const auto samples = motion_of(frames);
  EXPECT_TRUE(samples[2].valid);
  EXPECT_FALSE(samples[3].valid);
  EXPECT_FALSE(samples[4].valid);
  EXPECT_TRUE(samples[5].valid);
  EXPECT_EQ(samples[5].speed_mps, 0.0);
}

TEST(Motion, NoTimeNoSample) {
  EXPECT_FALSE(motion_of(std::vector{at(0, {}), at(0, {})})[1].valid);
}

TEST(Limits, AreKeptExactlyAtTheirValuesAndBrokenBeyond) {
  const CameraLimits limits;
  MotionSample sample{10, 10, 3, 12, true};
  EXPECT_FALSE(breaks_limits(sample, limits));
  sample.speed_mps = 10.001;
  EXPECT_TRUE(breaks_limits(sample, limits));
  sample = {0, 10.001, 0, 0, true};
  EXPECT_TRUE(breaks_limits(sample, limits));
  sample = {0, 0, 3.01, 0, true};
  EXPECT_TRUE(breaks_limits(sample, limits));
  sample = {0, 0, 0, 12.01, true};
  EXPECT_TRUE(breaks_limits(sample, limits));
}

TEST(Peaks, AreTheGreatestOfAllFrames) {
  // At 10 Hz: yaw by 0.1, 0.3 and 0.2 rad; x by 0.2, 0.5 and 0.4 m.
  const std::vector<CameraFrame> frames{at(0, {}), at(1, {0.2, 0, 0}, 0.1), at(2, {0.7, 0, 0}, 0.4),
                                        at(3, {1.1, 0, 0}, 0.6)};
  const RunMetrics metrics = summarize(std::vector<TargetMetrics>{}, frames, {}, CameraLimits{});
  EXPECT_NEAR(metrics.peak_speed_mps, 5.0, 1e-9);
  EXPECT_NEAR(metrics.peak_acceleration_mps2, 30.0, 1e-9);
  EXPECT_NEAR(metrics.rms_acceleration_mps2, std::sqrt((20.0 * 20 + 30 * 30 + 10 * 10) / 3), 1e-9);
  EXPECT_NEAR(metrics.peak_jerk_mps3, 400.0, 1e-6) << "from 30 to -10 m/s^2";
  EXPECT_NEAR(metrics.peak_angular_speed_radps, 3.0, 1e-9);
  EXPECT_NEAR(metrics.peak_angular_acceleration_radps2, 20.0, 1e-7);
}

TEST(AtTheAccelerationLimit, NinetyEightPercentIsBelow) {
  const auto share = [](double acceleration_mps2) {
    std::vector<CameraFrame> frames;
    double speed_mps = 0, x_m = 0;
    for (int k = 0; k < 9; ++k) {
      frames.push_back(at(k, {x_m, 0, 0}));
      speed_mps += acceleration_mps2 * kDt, x_m += speed_mps * kDt;
    }
    return summarize(std::vector<TargetMetrics>{}, frames, {}, CameraLimits{}).acceleration_limit_share;
  };
  EXPECT_EQ(share(9.8), 0.0);
  EXPECT_EQ(share(9.95), 1.0);
}

TEST(Percentile, IsTheNearestRank) {
  EXPECT_EQ(percentile({}, 0.5), 0.0);
  EXPECT_EQ(percentile({7}, 0.99), 7.0);
  EXPECT_EQ(percentile({4, 1, 3, 2}, 0.5), 2.0);
  EXPECT_EQ(percentile({4, 1, 3, 2}, 0.51), 3.0);
  EXPECT_EQ(percentile({4, 1, 3, 2}, 1.0), 4.0);
  EXPECT_EQ(percentile({4, 1, 3, 2}, 0.0), 1.0);
}

TEST(HiddenShare, IsOfTheTargetsThatHaveAPixelInThePicture) {
  constexpr uint64_t kAnna = 1, kBen = 2;
  std::vector<FrameTruth> truths(3);
  truths[0].picture.emplace().targets = {{kAnna, 100, 50, true}, {kBen, 100, 100, true}};
  // beside the picture, not hidden
  truths[1].picture.emplace().targets = {{kAnna, 100, 100, true}, {kBen, 0, 0, false}};
  const std::vector<CameraFrame> frames{at(0, {}), at(1, {}), at(2, {})};
  const std::vector<TargetMetrics> targets{{.id = kAnna, .name = "anna"}, {.id = kBen, .name = "ben"}};
  const RunMetrics metrics = summarize(targets, frames, truths, CameraLimits{});
  EXPECT_EQ(metrics.pictures, 2u);
  EXPECT_DOUBLE_EQ(metrics.mean_hidden_share, 0.5 / 3);
  EXPECT_DOUBLE_EQ(metrics.targets[1].mean_visible_share, 0.5) << "this one counts a picture without the target";
}

// Two people and a wall that slides in front of both half-way through.
class Stage {
 public:
  Stage() {
    scenes::GlbWriter writer;
    const int person = writer.add_mesh("person", *tessellate(CapsuleShape{0.3f, 0.6f}), {1, 1, 1});
    const int wall = writer.add_mesh("wall", *tessellate(BoxShape{{4, 4, 0.1f}}), {1, 1, 1});
    const auto role = [](const char* name) { return nlohmann::ordered_json{{"sightline", {{"role", name}}}}; };
    writer.add_node({"anna", -1, person, -1, {-1, 0, 0}, {1, 0, 0, 0}, role("target")});
    writer.add_node({"ben", -1, person, -1, {1, 0, 0}, {1, 0, 0, 0}, role("target")});
    const int slide = writer.add_node({"slide", -1, wall, -1, {20, 0, 4}, {1, 0, 0, 0}, role("occluder")});
    writer.add_node({"eye", -1, -1, writer.add_camera(0.8, 1.5, 0.1), {0, 0, 8}, {1, 0, 0, 0}, role("camera")});
    writer.add_node({"pillar", -1, person, -1, {40, 0, 0}, {1, 0, 0, 0}, {}});
    const glm::quat still(1, 0, 0, 0);
    writer.animate(slide, std::vector<float>{0.0f, 0.44f, 0.46f, 1.0f},
                   std::vector<glm::vec3>{{20, 0, 4}, {20, 0, 4}, {0, 0, 4}, {0, 0, 4}},
                   std::vector<glm::quat>{still, still, still, still});
    const auto asset = read_gltf(writer.finish("scenario"), nullptr, store);
    scenario = std::make_unique<Scenario>(*Scenario::from_asset(*asset));
  }
  std::vector<CameraFrame> ten_frames() const {
    std::vector<CameraFrame> frames;
    for (int k = 0; k < 10; ++k) {
      frames.push_back(at(k, scenario->camera().position_m));
      frames.back().lens = scenario->lens();
    }
    return frames;
  }
  RunMetrics measure(std::span<const CameraFrame> frames, JudgeOptions options = {}) {
    const auto truths = judge(*scenario, store, device, frames, options);
    return summarize(*scenario, frames, *truths, CameraLimits{});
  }

  GeometryStore store;
  EmbreeDevice device;
  std::unique_ptr<Scenario> scenario;
};

TEST(RunMetrics, SharesAreOfTheFrames) {
  Stage stage;
  const RunMetrics metrics = stage.measure(stage.ten_frames());
  EXPECT_EQ(metrics.pictures, 10u);
  EXPECT_DOUBLE_EQ(metrics.r_n, 0.5) << "hidden from 0.5 s on";
  EXPECT_DOUBLE_EQ(metrics.r_p, 0.0);
  EXPECT_DOUBLE_EQ(metrics.all_seen, 0.5);
  EXPECT_DOUBLE_EQ(metrics.joint_visible_share(), 0.5);
  EXPECT_DOUBLE_EQ(metrics.joint_whole_share, 0.5)
      << "where they are not hidden, they are in the picture from head to foot";
  EXPECT_DOUBLE_EQ(metrics.mean_whole_share, 0.5);
  EXPECT_GT(metrics.p95_size_pictures, 0.0);
  EXPECT_LT(metrics.p95_size_pictures, 1.0);
  ASSERT_EQ(metrics.targets.size(), 2u);
  EXPECT_EQ(metrics.targets[1].name, "ben");
  EXPECT_DOUBLE_EQ(metrics.targets[0].mean_visible_share, 0.5);
  EXPECT_DOUBLE_EQ(metrics.targets[0].in_frame_share, 1.0);
  EXPECT_DOUBLE_EQ(metrics.mean_visible_share, 0.5);
  EXPECT_DOUBLE_EQ(metrics.in_frame_share, 1.0) << "the mean over both targets";
}

TEST(RunMetrics, ThreadsAndStridesChangeTheCostOnly) {
  Stage stage;
  JudgeOptions threads;
  threads.threads = 3;
  EXPECT_EQ(to_json(stage.measure(stage.ten_frames(), threads)), to_json(stage.measure(stage.ten_frames())));
  JudgeOptions second;
  second.picture_every = 2;
  EXPECT_EQ(stage.measure(stage.ten_frames(), second).pictures, 5u);
  EXPECT_EQ(stage.measure(stage.ten_frames(), second).frames, 10u);
  JudgeOptions none;
  none.picture_every = 0;
  EXPECT_EQ(stage.measure(stage.ten_frames(), none).r_n, 0.0);
}

TEST(RunMetrics, CollisionsViolationsAndPathLengthAreCounted) {
  Stage stage;
  std::vector<CameraFrame> frames = stage.ten_frames();
  for (int k = 5; k < 10; ++k) frames[k].camera.position_m = {0, 0, 4.2};
  const RunMetrics metrics = stage.measure(frames);
  EXPECT_EQ(metrics.body_collisions, 5u);
  EXPECT_NEAR(metrics.least_clearance_m, 0.1, 1e-5);
  EXPECT_NEAR(metrics.d_c_m, 3.8, 1e-9);
  EXPECT_EQ(metrics.limit_violations, 2u) << "too fast at 0.5 s, and too sudden a stop at 0.6 s";
  EXPECT_NEAR(metrics.peak_speed_mps, 38, 1e-9);
}

TEST(RunMetrics, JsonHoldsEveryFigure) {
  Stage stage;
  const auto json = nlohmann::json::parse(to_json(stage.measure(stage.ten_frames())));
  EXPECT_EQ(json["r_n"], 0.5);
  EXPECT_EQ(json["targets"][0]["name"], "anna");
  EXPECT_EQ(json["body_collisions"], 0);
}

TEST(ScenarioWorldTest, ActorsAreWhatMoves) {
  Stage stage;
  const auto world = ScenarioWorld::make(*stage.scenario, stage.store, stage.device);
  ASSERT_TRUE(world);
  size_t moving = 0;
  for (const Instance& instance : (*world)->mirror().instances()) {
    const bool is_actor = instance.id >= 1 && instance.id <= stage.scenario->actors().size();
    EXPECT_EQ(instance.moving, is_actor) << instance.id;
    moving += instance.moving;
  }
  EXPECT_EQ(moving, 3u);
  EXPECT_GT((*world)->mirror().instances().size(), 3u) << "and a pillar, which does not";
}

// One target walks 4 m along x and rises by 1 m in a second; the other stands. The centre moves half as much.
TEST(Follow, MovesWithTheTargetsCentre) {
  scenes::GlbWriter writer;
  const int person = writer.add_mesh("person", *tessellate(CapsuleShape{0.3f, 0.6f}), {1, 1, 1});
  const auto role = [](const char* name) { return nlohmann::ordered_json{{"sightline", {{"role", name}}}}; };
  const int walker = writer.add_node({"anna", -1, person, -1, {-1, 0, 0}, {1, 0, 0, 0}, role("target")});
  writer.add_node({"ben", -1, person, -1, {1, 0, 0}, {1, 0, 0, 0}, role("target")});
  writer.add_node({"eye", -1, -1, writer.add_camera(0.8, 1.5, 0.1), {0, 2, 8}, {1, 0, 0, 0}, role("camera")});
  writer.animate(walker, std::vector<float>{0, 1}, std::vector<glm::vec3>{{-1, 0, 0}, {3, 1, 0}},
                 std::vector<glm::quat>(2, glm::quat(1, 0, 0, 0)));
  GeometryStore store;
  EmbreeDevice device;
  const Scenario scenario = *Scenario::from_asset(*read_gltf(writer.finish("scenario"), nullptr, store));
  const auto world = ScenarioWorld::make(scenario, store, device);
  ASSERT_TRUE(world);
  (*world)->set_time(0.7);  // wherever the world stands, the offset is that of the start
  std::vector<CameraFrame> frames{at(0, {}), at(5, {}), at(10, {})};
  frames[1].jump = true;
  const auto path = follow_path(**world, frames);
  ASSERT_EQ(path.size(), 3u);
  for (size_t i = 0; i < 3; ++i) {
    const double t = 0.5 * static_cast<double>(i);
    EXPECT_LT(glm::distance(path[i].camera.position_m, glm::dvec3(2 * t, 2 + 0.5 * t, 8)), 1e-5) << i;
    EXPECT_EQ(path[i].camera.rotation, path[0].camera.rotation);
    EXPECT_EQ(path[i].time_s, frames[i].time_s);
    EXPECT_FALSE(path[i].jump);
  }
  const glm::dvec3 forward = path[0].camera.rotation * glm::dvec3(0, 0, -1);
  EXPECT_LT(glm::distance(forward, glm::normalize(glm::dvec3(0, -2, -8))), 1e-6);
}

TEST(Follow, KeepsItsOffsetFromTheTargetsCentre) {
  Stage stage;
  auto world = ScenarioWorld::make(*stage.scenario, stage.store, stage.device);
  ASSERT_TRUE(world);
  const auto path = follow_path(**world, stage.ten_frames());
  for (const CameraFrame& frame : path) {
    EXPECT_LT(glm::distance(frame.camera.position_m, glm::dvec3(0, 0, 8)), 1e-6) << "the targets stand still";
    const glm::dvec3 forward = frame.camera.rotation * glm::dvec3(0, 0, -1);
    EXPECT_LT(glm::distance(forward, glm::dvec3(0, 0, -1)), 1e-6);
  }
}

}  // namespace
}  // namespace sightline
