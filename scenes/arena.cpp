#include "scenes/arena.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "scenes/exact.h"
#include "scenes/scenario_builder.h"
#include "scenes/shapes.h"

namespace sightline::scenes {
namespace {

// Targets run along the lines of a square grid, one node a step and all in step; obstacles stand in its
// cells. A target never steps to a node that another one occupies or has chosen, so two targets are never nearer than
// about half a pitch.
constexpr double kPitch_m = 3.25;
constexpr int kReach = 2;        // nodes (-2 .. 2) x (-2 .. 2) without the four corners
constexpr double kStep_s = 1.3;  // 2.5 m/s
constexpr double kWallRadius_m = 11.0;
constexpr double kWallHeight_m = 1.5;
constexpr int kWallPieces = 32;

struct Node {
  int x = 0, z = 0;
  bool operator==(const Node&) const = default;
};

bool is_in_arena(const Node& n) {
  return std::max(std::abs(n.x), std::abs(n.z)) <= kReach && std::abs(n.x) + std::abs(n.z) < 2 * kReach;
}

// The step of one target: a free neighbour, never straight back; it waits for a step when there is none.
Node choose_step(const Node& here, const Node& before, const std::vector<Node>& taken, CounterRandom& random) {
  std::vector<Node> free;
  for (const Node& next :
       {Node{here.x + 1, here.z}, Node{here.x, here.z + 1}, Node{here.x - 1, here.z}, Node{here.x, here.z - 1}})
    if (is_in_arena(next) && std::find(taken.begin(), taken.end(), next) == taken.end()) free.push_back(next);
  std::erase(free, before);  // of one that has waited, `before` is `here`
  return free.empty() ? here : free[random.next_below(static_cast<uint32_t>(free.size()))];
}

// One row of nodes for each target, a step apart.
std::vector<std::vector<Node>> choose_runs(int targets, double duration_s, CounterRandom& random) {
  static constexpr Node kStarts[] = {{0, 1}, {0, -1}, {-1, 0}, {1, 0}, {-2, 1}, {2, -1}, {1, 2}, {-1, -2}};
  std::vector<std::vector<Node>> runs;
  for (int k = 0; k < targets; ++k) runs.push_back({kStarts[k]});
  const auto steps = static_cast<size_t>(std::ceil(duration_s / kStep_s)) + 1;
  for (size_t step = 0; step < steps; ++step) {
    std::vector<Node> taken;
    for (const auto& run : runs) taken.push_back(run.back());
    for (auto& run : runs) {
      const Node before = run.size() > 1 ? run[run.size() - 2] : run.back();
      run.push_back(choose_step(run.back(), before, taken, random));
      taken.push_back(run.back());
    }
  }
  return runs;
}

TimedPath path_of(const std::vector<Node>& run) {
  Polyline corners;
  std::vector<double> times_s;
  for (size_t k = 0; k < run.size(); ++k) {
    corners.push_back({run[k].x * kPitch_m, run[k].z * kPitch_m});
    times_s.push_back(static_cast<double>(k) * kStep_s);
  }
  return {corners, times_s};
}

void add_obstacles(ScenarioBuilder& scene, CounterRandom& random) {
  const double heights[] = {1.0, 1.75, 2.5, 3.5};
  std::vector<int> meshes;
  for (double height : heights) {
    MeshData drum;
    append_frustum(drum, {0, 0, 0}, 0.875, 0.8125, height, 16);
    const int number = static_cast<int>(meshes.size()) / 2;
    meshes.push_back(scene.add_mesh(numbered("drum", number), drum, colors::kStone));
    meshes.push_back(scene.add_mesh(numbered("crate", number), standing_box(1.625, height, 1.625), colors::kWood));
  }
  int count = 0;
  for (int x = -kReach; x < kReach; ++x)
    for (int z = -kReach; z < kReach; ++z) {
      if (random.next_below(5) == 0) continue;  // a gap to see through
      const int mesh = meshes[random.next_below(static_cast<uint32_t>(meshes.size()))];
      scene.add_static(numbered("obstacle", ++count), mesh, {(x + 0.5) * kPitch_m, 0, (z + 0.5) * kPitch_m});
    }
}

void add_shell(ScenarioBuilder& scene) {
  const int ground = scene.add_mesh("ground", standing_box(60, 0.25, 60), colors::kFloor);
  scene.add_static("ground", ground, {0, -0.25, 0});
  // 2 r tan(pi / 32), and a little to close the corners.
  const int piece = scene.add_mesh("wall", standing_box(2.1875, kWallHeight_m, 0.25), colors::kWall);
  for (int i = 0; i < kWallPieces; ++i) {
    const glm::dvec2 out = circle_point(static_cast<double>(i) / kWallPieces);
    scene.add_static(numbered("wall", i), piece, {kWallRadius_m * out.x, 0, kWallRadius_m * out.y}, facing(out));
  }
}

Motion circle(double radius_m, double speed_mps, double phase_turns, double duration_s) {
  Motion motion;
  const auto last = static_cast<int>(std::floor(duration_s * kKeysPerSecond + 0.5));
  const double turns_per_second = speed_mps / (radius_m * 2 * std::numbers::pi);
  for (int i = 0; i <= last; ++i) {
    const double time_s = i / kKeysPerSecond;
    const glm::dvec2 out = circle_point(phase_turns + turns_per_second * time_s);
    motion.add(time_s, {radius_m * out.x, 0, radius_m * out.y}, facing(out));
  }
  return motion;
}

// Between the outermost nodes and the wall: a slow cart that a camera can bump into, and two quick screens.
void add_movers(ScenarioBuilder& scene, double duration_s, CounterRandom& random) {
  const int cart = scene.add_mesh("cart", standing_box(1.5, 1.75, 0.875), colors::kMetal);
  const int screen = scene.add_mesh("screen", standing_box(2.5, 3.0, 0.125), colors::kCurtain);
  InstanceAttributes passable;
  passable.collides = false;
  constexpr double kRadius_m = 9.5;
  scene.add_occluder("cart", cart, circle(kRadius_m, 0.75, random.next_in(0, 1), duration_s), {});
  scene.add_occluder("screen-1", screen, circle(kRadius_m, 2.5, random.next_in(0, 1), duration_s), passable);
  scene.add_occluder("screen-2", screen, circle(kRadius_m, -3.5, random.next_in(0, 1), duration_s), passable);
}

}  // namespace

std::vector<std::byte> make_arena(const ArenaOptions& options) {
  assert(options.targets >= 2 && options.targets <= 8);
  CounterRandom run_random(options.seed, 0, RandomPurpose::kSceneGeneration);
  CounterRandom obstacle_random(options.seed, 1, RandomPurpose::kSceneGeneration);
  CounterRandom mover_random(options.seed, 2, RandomPurpose::kSceneGeneration);
  ScenarioBuilder scene(options.duration_s);
  add_shell(scene);
  add_obstacles(scene, obstacle_random);
  scene.add_camera({0, 5, 16}, {0, 1, 0});
  int count = 0;
  for (const auto& run : choose_runs(options.targets, options.duration_s, run_random))
    scene.add_character(numbered("target", ++count), walk(path_of(run), options.duration_s));
  add_movers(scene, options.duration_s, mover_random);
  return scene.write();
}

}  // namespace sightline::scenes
