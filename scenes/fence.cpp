#include "scenes/fence.h"

#include <algorithm>
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
constexpr double kHalfThickness_m = 0.02;
// The picket between the targets at the start stands this near to the middle, so that its neighbours stand outside of
// both.
constexpr double kOffMiddle_m = 0.02;
// For this long the fence stands.
constexpr double kRest_s = 0.25;
constexpr double kBoard_z_m = 1.25;
constexpr double kBoardWidth_m = 2.6;
constexpr double kBoardHeight_m = 2.5;
constexpr double kBoardComing_s = 0.25;

// Pickets from one between the two targets outwards, and two rails. `start_x_m`: where the fence begins, so that the
// mesh is moved by as much the other way.
MeshData fence_mesh(CounterRandom& random, const FenceOptions& options, double start_x_m) {
  MeshData mesh;
  const double half_m = snap(options.picket_m / 2);
  const auto picket = [&](double x) {
    append_box(mesh, {x - half_m, 0, -kHalfThickness_m}, {x + half_m, kFenceHeight_m, kHalfThickness_m});
  };
  const auto next_m = [&] { return 2 * half_m + snapped_in(random, options.least_gap_m, options.greatest_gap_m); };
  const double middle = snapped_in(random, -kOffMiddle_m, kOffMiddle_m) - snap(start_x_m);
  for (double x = middle; x < kFenceHalfWidth_m; x += next_m()) picket(x);
  for (double x = middle - next_m(); x > -kFenceHalfWidth_m; x -= next_m()) picket(x);
  for (double y : {0.3, 1.9})
    append_box(mesh, {-kFenceHalfWidth_m, y, -2 * kHalfThickness_m}, {kFenceHalfWidth_m, y + 0.06, -kHalfThickness_m});
  return mesh;
}

// The position of the fence `turns` periods after its left stop.
double place_m(const FenceOptions& options, double turns) {
  const double part = turns - std::floor(turns);
  return options.amplitude_m * (part < 0.5 ? 4 * part - 1 : 3 - 4 * part);
}

// Keys of straight motion from stop to stop, after a moment at rest.
Motion to_and_fro(const FenceOptions& options, double phase_turns) {
  Motion motion;
  const auto add = [&](double time_s) {
    const double x = place_m(options, std::max(time_s - kRest_s, 0.0) / options.period_s + phase_turns);
    motion.add(time_s, {x, 0, kFence_z_m}, {1, 0, 0, 0});
  };
  add(0.0);
  add(kRest_s);
  for (double half_turns = std::floor(2 * phase_turns) + 1;; half_turns += 1) {
    const double time_s = kRest_s + (half_turns / 2 - phase_turns) * options.period_s;
    if (time_s >= options.duration_s) break;
    if (time_s > kRest_s) add(time_s);
  }
  add(options.duration_s);
  return motion;
}

Motion standing(const glm::dvec3& position_m, double duration_s) {
  Motion motion;
  for (double time_s : {0.0, duration_s}) motion.add(time_s, position_m, {1, 0, 0, 0});
  return motion;
}

// Adds the board, which comes up out of the ground and stays.
void add_board(ScenarioBuilder& scene, const FenceOptions& options) {
  const double hidden_y_m = -kBoardHeight_m - 0.5;
  Motion motion;
  for (double time_s : {0.0, options.board_at_s}) motion.add(time_s, {0, hidden_y_m, kBoard_z_m}, {1, 0, 0, 0});
  motion.add(options.board_at_s + kBoardComing_s, {0, 0, kBoard_z_m}, {1, 0, 0, 0});
  InstanceAttributes attributes;
  attributes.collides = false;  // it comes faster than a camera can flee
  const int board = scene.add_mesh("board", standing_box(kBoardWidth_m, kBoardHeight_m, 0.0625), colors::kWood);
  scene.add_occluder("board", board, motion, attributes);
}

}  // namespace

std::vector<std::byte> make_fence(const FenceOptions& options) {
  CounterRandom random(options.seed, 0, RandomPurpose::kSceneGeneration);
  ScenarioBuilder scene(options.duration_s);
  scene.add_static("ground", scene.add_mesh("ground", standing_box(40, 0.25, 40), colors::kFloor), {0, -0.25, 0});
  scene.add_camera({0, 1.6, options.camera_distance_m}, {0, kBodyHeight_m / 2, 0}, options.limits);
  const double half = kBetweenTargets_m / 2;
  scene.add_character("target-1", standing({-half, 0, snapped_in(random, -0.1, 0.1)}, options.duration_s));
  scene.add_character("target-2", standing({half, 0, snapped_in(random, -0.1, 0.1)}, options.duration_s));
  InstanceAttributes attributes;
  attributes.collides = false;  // it would sweep through the camera
  const double phase_turns = random.next_in(0, 1);
  const int fence = scene.add_mesh("fence", fence_mesh(random, options, place_m(options, phase_turns)), colors::kWood);
  scene.add_occluder("fence", fence, to_and_fro(options, phase_turns), attributes);
  if (options.board_at_s > 0) add_board(scene, options);
  return scene.write();
}

}  // namespace sightline::scenes
