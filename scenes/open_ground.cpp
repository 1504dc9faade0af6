#include "scenes/open_ground.h"

#include <cmath>

#include "scenes/exact.h"
#include "scenes/shapes.h"
#include "scenes/vehicle_path.h"

namespace sightline::scenes {
namespace {

void add_plane(ScenarioBuilder& scene, double half_m) {
  const int ground = scene.add_mesh("ground", standing_box(2 * half_m, 0.25, 2 * half_m), colors::kFloor);
  scene.add_static("ground", ground, {0, -0.25, 0});
}

TimedPath timed(const Polyline& line, double speed_mps) {
  std::vector<double> times_s{0};
  for (size_t k = 1; k < line.size(); ++k)
    times_s.push_back(times_s.back() + length(line[k] - line[k - 1]) / speed_mps);
  return {line, times_s};
}

glm::dvec2 chosen_direction(CounterRandom& random) {
  return circle_point(snapped_in(random, 0, 1));
}

// A straight line with times such that the speed grows to `fast`, holds, and then is `slow`.
TimedPath sprint_path(const glm::dvec2& direction, double fast_mps, double slow_mps, double growing_s,
                      double duration_s) {
  Polyline line{{0, 0}};
  std::vector<double> times_s{0};
  constexpr double kPiece_s = 0.1;
  for (double time_s = kPiece_s, way_m = 0; time_s <= duration_s + 1; time_s += kPiece_s) {
    const double grown = std::min(1.0, time_s / growing_s),
                 shrunk = std::clamp((time_s - duration_s / 2) / 3.0, 0.0, 1.0);
    way_m += (fast_mps * grown * (1 - shrunk) + slow_mps * shrunk) * kPiece_s;
    line.push_back(direction * way_m);
    times_s.push_back(time_s);
  }
  return {line, times_s};
}

}  // namespace

std::vector<std::byte> make_sprint(const SprintOptions& options) {
  CounterRandom random(options.seed, 0, RandomPurpose::kSceneGeneration);
  const glm::dvec2 direction = chosen_direction(random);
  const double limit = options.limits.max_speed_mps;
  const double growing_s = 1.3 * limit / (0.75 * options.limits.max_acceleration_mps2) + random.next_in(0, 2);
  const TimedPath path = sprint_path(direction, 1.3 * limit, 0.8 * limit, growing_s, options.duration_s);
  ScenarioBuilder scene(options.duration_s);
  add_plane(scene, 2.0 * limit * options.duration_s);
  scene.add_camera({-8 * direction.x, 3, -8 * direction.y}, {0, 1, 0}, options.limits);
  scene.add_target("car", scene.add_mesh("car", vehicle_mesh(), colors::kBody), walk(path, options.duration_s));
  return scene.write();
}

std::vector<std::byte> make_parting(const PartingOptions& options) {
  CounterRandom random(options.seed, 0, RandomPurpose::kSceneGeneration);
  const glm::dvec2 forward = chosen_direction(random), right{-forward.y, forward.x};
  constexpr double kSpeed_mps = 1.5, kTogether_s = 8, kApart_s = 28, kStay_s = 6, kHalf_m = 30;
  const auto way = [&](double side) {
    const glm::dvec2 start = right * (0.6 * side), parts = start + forward * (kSpeed_mps * kTogether_s);
    const glm::dvec2 far = right * (kHalf_m * side) + forward * (kSpeed_mps * kTogether_s + 8),
                     back = parts + forward * 16.0;
    const double there_s = kApart_s + kStay_s, again_s = there_s + kApart_s - kTogether_s;
    return TimedPath({start, parts, far, far, back, back + forward * 10.0},
                     {0, kTogether_s, kApart_s, there_s, again_s, again_s + 10 / kSpeed_mps});
  };
  const glm::dvec2 start = right * 0.6, parts = start + forward * (kSpeed_mps * kTogether_s);
  const TimedPath leaving({start, parts, parts + right * 480.0}, {0, kTogether_s, kTogether_s + 60});
  ScenarioBuilder scene(options.duration_s);
  add_plane(scene, 1000);
  scene.add_camera({-5 * forward.x, 2.2, -5 * forward.y}, {0, 1.1, 0});
  scene.add_character("target-1", walk(way(-1), options.duration_s));
  scene.add_character("target-2", walk(options.for_good ? leaving : way(1), options.duration_s));
  return scene.write();
}

std::vector<std::byte> make_teleport(const TeleportOptions& options) {
  CounterRandom random(options.seed, 0, RandomPurpose::kSceneGeneration);
  constexpr double kSpeed_mps = 1.6, kEvery_s = 8;
  Motion motion = walk(timed({{0, 0}, {2 * options.duration_s, 0}}, kSpeed_mps), options.duration_s);
  glm::dvec2 offset{0, 0};
  double next_s = kEvery_s;
  for (size_t i = 0; i < motion.times_s.size(); ++i) {
    if (motion.times_s[i] >= next_s) {
      offset += chosen_direction(random) * options.jump_m;
      next_s += kEvery_s;
    }
    motion.positions_m[i] = snap_key(motion.positions_m[i] + glm::dvec3(offset.x, 0, offset.y));
  }
  ScenarioBuilder scene(options.duration_s);
  add_plane(scene, 200);
  const int column = scene.add_mesh("column", standing_box(0.75, 4, 0.75), colors::kStone);
  int count = 0;
  for (int k = 0; k < 300; ++k) {
    const glm::dvec2 p{snapped_in(random, -70, 120), snapped_in(random, -70, 70)};
    double nearest = length(p - glm::dvec2(-4, 0));
    for (const glm::dvec3& at : motion.positions_m) nearest = std::min(nearest, length(p - glm::dvec2(at.x, at.z)));
    if (nearest > 1.2) scene.add_static(numbered("column", ++count), column, {p.x, 0, p.y});
  }
  scene.add_camera({-4, 2, 0}, {0, 1.1, 0});
  scene.add_character("target-1", motion);
  return scene.write();
}

std::vector<std::byte> make_walled_in(const WalledInOptions& options) {
  CounterRandom random(options.seed, 0, RandomPurpose::kSceneGeneration);
  constexpr double kHalf_m = 6, kThick_m = 0.3;
  Polyline line{{0, 0}};
  while (line.size() < 40) {
    const glm::dvec2 next{snapped_in(random, -4, 4), snapped_in(random, -4, 4)};
    if (length(next - line.back()) > 2) line.push_back(next);
  }
  ScenarioBuilder scene(options.duration_s);
  add_plane(scene, 30);
  const int wall = scene.add_mesh("wall", standing_box(2 * kHalf_m + kThick_m, 3, kThick_m), colors::kWall);
  for (int k = 0; k < 4; ++k) {
    const glm::dvec2 out = circle_point(k / 4.0) * kHalf_m;
    scene.add_static(numbered("wall", k), wall, {out.x, 0, out.y}, quarter_turns(k % 2 == 0 ? 1 : 0));
  }
  const glm::dvec2 eye = circle_point(random.next_below(4) / 4.0) * kHalf_m;
  scene.add_camera({eye.x, 1.5, eye.y}, {0, 1.1, 0});
  scene.add_character("target-1", walk(timed(line, 1.6), options.duration_s));
  return scene.write();
}

}  // namespace sightline::scenes
