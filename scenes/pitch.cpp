#include "scenes/pitch.h"

#include <array>
#include <cmath>

#include "scenes/exact.h"
#include "scenes/scenario_builder.h"
#include "scenes/shapes.h"

namespace sightline::scenes {
namespace {

constexpr double kHalfLength_m = 52.5, kHalfWidth_m = 34.0;  // along x and z
constexpr double kAttack_mps = 4.5;                          // of the middle between the two runners
constexpr double kBall_mps = 12.0, kArc_m = 2.6, kBallRadius_m = 0.11;
constexpr double kHold_s = 1.2;       // between two passes
constexpr double kAhead_m = 0.75;     // of the ball before its runner
constexpr double kKeepOff_m = 3.0;    // the others from the two
constexpr double kWithTheGame = 0.4;  // the share of the game's movement that the others follow
constexpr int kOthers = 20;

// A walk of the game over the pitch, to random places one after the other.
TimedPath wandering(const glm::dvec2& start, const glm::dvec2& reach_m, double speed_mps, double duration_s,
                    CounterRandom& random) {
  Polyline line{start};
  std::vector<double> times_s{0};
  while (times_s.back() < duration_s + 2) {
    const glm::dvec2 next{snapped_in(random, -reach_m.x, reach_m.x), snapped_in(random, -reach_m.y, reach_m.y)};
    const double way_m = length(next - line.back());
    if (way_m < 3) continue;
    line.push_back(next);
    times_s.push_back(times_s.back() + way_m / speed_mps);
  }
  return {line, times_s};
}

// The two runners have the ball and run side by side. Their distance changes between 6 and 10 m.
glm::dvec2 runner_m(const TimedPath& game, int which, double time_s) {
  const glm::dvec2 breath = circle_point(time_s / 9.0);
  const double half = 4.0 + breath.y, lean = 1.5 * breath.x;
  return game.position_m(time_s) + (which == 0 ? glm::dvec2(lean, half) : glm::dvec2(-lean, -half));
}

// Where the others stand when the game is in the middle.
glm::dvec2 home_of(int player) {
  static constexpr std::array<glm::dvec2, 10> kHalf{
      {{-48, 0}, {-34, -20}, {-36, -7}, {-36, 7}, {-34, 20}, {-16, -22}, {-20, -6}, {-18, 8}, {-15, 21}, {-5, 3}}};
  const glm::dvec2 home = kHalf[static_cast<size_t>(player % 10)];
  return player < 10 ? home : glm::dvec2(-home.x, -home.y);
}

// Pushed out of the way of the two.
glm::dvec2 kept_off(glm::dvec2 p, const glm::dvec2& runner) {
  const glm::dvec2 away = p - runner;
  const double distance = length(away);
  return distance >= kKeepOff_m || distance < 1e-6 ? p : runner + away * (kKeepOff_m / distance);
}

struct Pass {
  int from = 0;
  double leaves_s = 0, arrives_s = 0;
};

std::vector<Pass> passes_of(const TimedPath& game, double duration_s) {
  std::vector<Pass> passes;
  double time_s = kHold_s;
  for (int holder = 0; time_s < duration_s + 1; holder = 1 - holder) {
    const double flight_s = length(runner_m(game, 0, time_s) - runner_m(game, 1, time_s)) / kBall_mps;
    passes.push_back({holder, time_s, time_s + flight_s});
    time_s += flight_s + kHold_s;
  }
  return passes;
}

// Where the ball is while a player has it: on the side of the other one, where passes leave and arrive.
glm::dvec2 ball_with(const TimedPath& game, int holder, double time_s) {
  const glm::dvec2 here = runner_m(game, holder, time_s), there = runner_m(game, 1 - holder, time_s);
  return here + (there - here) * (kAhead_m / length(there - here));
}

glm::dvec3 ball_m(const TimedPath& game, const std::vector<Pass>& passes, double time_s) {
  int holder = 0;
  for (const Pass& pass : passes) {
    if (time_s < pass.leaves_s) break;
    holder = 1 - pass.from;
    if (time_s > pass.arrives_s) continue;
    const double u = (time_s - pass.leaves_s) / (pass.arrives_s - pass.leaves_s);
    const glm::dvec2 p = ball_with(game, pass.from, time_s) * (1 - u) + ball_with(game, holder, time_s) * u;
    return {p.x, 4 * kArc_m * u * (1 - u), p.y};
  }
  const glm::dvec2 p = ball_with(game, holder, time_s);
  return {p.x, 0, p.y};
}

// Keys 60 times a second of a body at place(t), which faces its way.
template <typename Place>
Motion motion_of(double duration_s, const Place& place) {
  Motion motion;
  glm::dvec2 heading{0, 1};
  const auto last = static_cast<int>(duration_s * kKeysPerSecond + 0.5);
  for (int i = 0; i <= last; ++i) {
    const double time_s = i / kKeysPerSecond;
    const glm::dvec3 p = place(time_s), before = place(time_s - 0.25);
    const glm::dvec2 way{p.x - before.x, p.z - before.z};
    if (length(way) > 0.05) heading = way / length(way);
    motion.add(time_s, p, facing(heading));
  }
  return motion;
}

void add_others(ScenarioBuilder& scene, const TimedPath& game, CounterRandom& random) {
  MeshData body;
  append_capsule(body, {0, 0, 0}, kBodyRadius_m, kBodyHeight_m, 12, 3);
  const int teams[] = {scene.add_mesh("blue", body, colors::kCar), scene.add_mesh("red", body, colors::kCurtain)};
  InstanceAttributes attributes;
  attributes.collides = false;
  for (int player = 0; player < kOthers; ++player) {
    const TimedPath own = wandering({0, 0}, {3, 3}, 1.5, scene.duration_s(), random);
    const auto place = [&](double time_s) {
      glm::dvec2 p = home_of(player) + game.position_m(time_s) * kWithTheGame + own.position_m(time_s);
      for (const int which : {0, 1}) p = kept_off(p, runner_m(game, which, time_s));
      return glm::dvec3(p.x, 0, p.y);
    };
    scene.add_occluder(numbered("player", player + 1), teams[player / 10], motion_of(scene.duration_s(), place),
                       attributes);
  }
}

void add_ground(ScenarioBuilder& scene) {
  const int grass = scene.add_mesh("grass", standing_box(2 * kHalfLength_m + 30, 0.25, 2 * kHalfWidth_m + 30),
                                   colors::kLeaf);
  scene.add_static("grass", grass, {0, -0.25, 0});
  MeshData goal;
  for (const double z : {-3.66, 3.66}) append_box(goal, {-0.0625, 0, z - 0.0625}, {0.0625, 2.5, z + 0.0625});
  append_box(goal, {-0.0625, 2.4375, -3.6875}, {0.0625, 2.5625, 3.6875});
  const int mesh = scene.add_mesh("goal", goal, colors::kWall);
  scene.add_static("goal-1", mesh, {-kHalfLength_m, 0, 0});
  scene.add_static("goal-2", mesh, {kHalfLength_m, 0, 0});
  const int stand = scene.add_mesh("stand", standing_box(2 * kHalfLength_m, 6, 4), colors::kStone);
  for (const double z : {-1.0, 1.0})
    scene.add_static(z < 0 ? "stand-1" : "stand-2", stand, {0, 0, z * (kHalfWidth_m + 10)});
}

}  // namespace

std::vector<std::byte> make_pitch(const PitchOptions& options) {
  CounterRandom game_random(options.seed, 0, RandomPurpose::kSceneGeneration);
  CounterRandom player_random(options.seed, 1, RandomPurpose::kSceneGeneration);
  const TimedPath game = wandering({0, 0}, {kHalfLength_m - 10, kHalfWidth_m - 12}, kAttack_mps, options.duration_s,
                                   game_random);
  const std::vector<Pass> passes = passes_of(game, options.duration_s);

  ScenarioBuilder scene(options.duration_s);
  add_ground(scene);
  scene.add_camera({0, 8, 22}, {0, 1, 0}, {20, 15});
  for (const int which : {0, 1})
    scene.add_character(numbered("runner", which + 1), motion_of(options.duration_s, [&](double time_s) {
                          const glm::dvec2 p = runner_m(game, which, time_s);
                          return glm::dvec3(p.x, 0, p.y);
                        }));
  MeshData ball;
  append_capsule(ball, {0, 0, 0}, kBallRadius_m, 2 * kBallRadius_m, 12, 4);
  scene.add_target("ball", scene.add_mesh("ball", ball, colors::kWall),
                   motion_of(options.duration_s, [&](double time_s) { return ball_m(game, passes, time_s); }));
  add_others(scene, game, player_random);
  return scene.write();
}

}  // namespace sightline::scenes
