// The reaction to an occlusion, on a scene with a wall that comes and goes.
#include "client/truth/reaction.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "scenes/glb_writer.h"
#include "server/scene/gltf.h"
#include "server/scene/primitives.h"

namespace sightline {
namespace {

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
                 std::vector<glm::vec3>{away, away, between, between, away, away}, std::vector<glm::quat>(6, still));
  return writer.finish("scenario");
}

// The camera rests until `answer_tick`, and then moves upwards at 0.6 m/s.
std::vector<CameraFrame> answering_path(const Scenario& scenario, int answer_tick) {
  std::vector<CameraFrame> frames;
  for (int k = 0; k <= 270; ++k) {
    frames.push_back({k / 60.0, scenario.camera(), scenario.lens(), false});
    if (k >= answer_tick) frames.back().camera.position_m.y += 0.01 * (k - answer_tick + 1);
  }
  return frames;
}

struct Place {
  GeometryStore store;
  EmbreeDevice device;
  Scenario scenario;

  explicit Place(const std::vector<std::byte>& glb)
      : scenario(*Scenario::from_asset(*read_gltf(glb, nullptr, store))) {}
  std::unique_ptr<ScenarioWorld> world() { return *ScenarioWorld::make(scenario, store, device); }
};

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

}  // namespace
}  // namespace sightline
