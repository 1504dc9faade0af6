#include "scenes/fence.h"

#include <cmath>

#include "scenes/exact.h"
#include "scenes/scenario_builder.h"
#include "scenes/shapes.h"

namespace sightline::scenes {
namespace {

// Targets stand on the x axis and face the camera at +z.
constexpr double kBetweenTargets_m = 1.6;
constexpr double kFence_z_m = 2.0;
constexpr double kFenceHalfWidth_m = 5.0;
constexpr double kFenceHeight_m = 2.2;
constexpr double kPicket_m = 0.125;
constexpr double kHalfThickness_m = 0.02;
constexpr double kBoard_z_m = 1.25;
constexpr double kBoardWidth_m = 2.6;
constexpr double kBoardHeight_m = 2.5;
constexpr double kBoardComing_s = 0.25;

// Pickets 12.5 cm wide, 20 to 30 cm of air between them, two rails.
MeshData fence_mesh(CounterRandom& random) {
  MeshData mesh;
  for (double x = -kFenceHalfWidth_m; x < kFenceHalfWidth_m; x += kPicket_m + snapped_in(random, 0.2, 0.3))
    append_box(mesh, {x, 0, -kHalfThickness_m}, {x + kPicket_m, kFenceHeight_m, kHalfThickness_m});
  for (double y : {0.3, 1.9})
    append_box(mesh, {-kFenceHalfWidth_m, y, -2 * kHalfThickness_m},
               {kFenceHalfWidth_m, y + 0.06, -kHalfThickness_m});
  return mesh;
}

Motion to_and_fro(const FenceOptions& options, double phase_turns) {
  Motion motion;
  const auto last = static_cast<int>(std::floor(options.duration_s * kKeysPerSecond + 0.5));
  for (int i = 0; i <= last; ++i) {
    const double time_s = i / kKeysPerSecond;
    const double x = options.amplitude_m * circle_point(time_s / options.period_s + phase_turns).y;
    motion.add(time_s, {x, 0, kFence_z_m}, {1, 0, 0, 0});
  }
  return motion;
}

Motion standing(const glm::dvec3& position_m, double duration_s) {
  Motion motion;
  for (double time_s : {0.0, duration_s}) motion.add(time_s, position_m, {1, 0, 0, 0});
  return motion;
}

// Up out of the ground, and there to stay.
void add_board(ScenarioBuilder& scene, const FenceOptions& options) {
  const double hidden_y_m = -kBoardHeight_m - 0.5;
  Motion motion;
  for (double time_s : {0.0, options.board_at_s})
    motion.add(time_s, {0, hidden_y_m, kBoard_z_m}, {1, 0, 0, 0});
  motion.add(options.board_at_s + kBoardComing_s, {0, 0, kBoard_z_m}, {1, 0, 0, 0});
  InstanceAttributes attributes;
  attributes.collides = false;  // it comes faster than a camera can flee
  const int board =
      scene.add_mesh("board", standing_box(kBoardWidth_m, kBoardHeight_m, 0.0625), colors::kWood);
  scene.add_occluder("board", board, motion, attributes);
}

}  // namespace

std::vector<std::byte> make_fence(const FenceOptions& options) {
  CounterRandom random(options.seed, 0, RandomPurpose::kSceneGeneration);
  ScenarioBuilder scene(options.duration_s);
  scene.add_static("ground", scene.add_mesh("ground", standing_box(40, 0.25, 40), colors::kFloor),
                   {0, -0.25, 0});
  scene.add_camera({0, 1.6, options.camera_distance_m}, {0, 1.0, 0});
  const double half = kBetweenTargets_m / 2;
  scene.add_character("target-1", standing({-half, 0, snapped_in(random, -0.1, 0.1)}, options.duration_s));
  scene.add_character("target-2", standing({half, 0, snapped_in(random, -0.1, 0.1)}, options.duration_s));
  InstanceAttributes attributes;
  attributes.collides = false;  // it would sweep through the camera
  const int fence = scene.add_mesh("fence", fence_mesh(random), colors::kWood);
  scene.add_occluder("fence", fence, to_and_fro(options, random.next_in(0, 1)), attributes);
  if (options.board_at_s > 0) add_board(scene, options);
  return scene.write();
}

}  // namespace sightline::scenes
