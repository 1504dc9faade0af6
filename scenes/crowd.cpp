#include "scenes/crowd.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <optional>

#include "scenes/exact.h"
#include "scenes/scenario_builder.h"
#include "scenes/shapes.h"

namespace sightline::scenes {
namespace {

constexpr double kPlaza_m = 60.0;
constexpr int kColumns = 7;
constexpr double kColumnRadius_m = 0.5;
constexpr double kTick_s = 0.1;  // of plans; a walker turns only at a tick
constexpr double kMoverKeysPerSecond = 30.0;
// The least distance between the axes of two bodies in a plan. Plans have sharp corners, and walkers round them by up
// to 0.17 m, so 0.6 m remain.
constexpr double kApart_m = 0.95;
constexpr double kNear_m = 6.0;  // movers stay about the targets
constexpr double kSlowest_mps = 1.0, kFastest_mps = 1.6;
constexpr double kFreeView_m = 1.5;  // around the camera's start, at first
constexpr double kFreeView_s = 1.0;

// The position of one person at each tick.
using Plan = std::vector<glm::dvec2>;

struct Column {
  glm::dvec2 middle_m;
};

// The walk of the targets' middle: around the plaza, at a distance from its middle that changes.
struct Round {
  Polyline corners;
  std::vector<double> times_s{0};
};

Round walk_round(double duration_s, CounterRandom& random) {
  double turns = random.next_in(0, 1);
  const double side = random.next_below(2) == 0 ? -1 : 1;
  Round round{{circle_point(turns) * random.next_in(5.0, 7.0)}};
  while (round.times_s.back() < duration_s + 1) {
    turns += side * random.next_in(0.1, 0.15);
    const glm::dvec2 next = circle_point(turns) * random.next_in(5.0, 7.0);
    const double step_m = length(next - round.corners.back());
    round.times_s.push_back(round.times_s.back() + step_m / random.next_in(1.3, 1.7));
    round.corners.push_back(next);
  }
  return round;
}

size_t ticks_in(double duration_s) {
  return static_cast<size_t>(std::ceil((duration_s + 0.5) / kTick_s)) + 1;  // half a second more: the last corner
}

Plan plan_of(const TimedPath& path, double duration_s) {
  Plan plan;
  for (size_t tick = 0; tick < ticks_in(duration_s); ++tick)
    plan.push_back(path.position_m(static_cast<double>(tick) * kTick_s));
  return plan;
}

std::vector<Column> place_columns(const std::array<Plan, 2>& targets, const glm::dvec2& eye_m, CounterRandom& random) {
  std::vector<Column> columns;
  const auto is_free = [&](const glm::dvec2& p) {
    const auto keeps = [&p](double least_m) {
      return [&p, least_m](const glm::dvec2& at) { return length(at - p) >= least_m; };
    };
    return length(p - eye_m) >= kFreeView_m + kColumnRadius_m &&
           std::all_of(columns.begin(), columns.end(), [&](const Column& c) { return length(c.middle_m - p) >= 3; }) &&
           std::all_of(targets[0].begin(), targets[0].end(), keeps(kColumnRadius_m + 0.6)) &&
           std::all_of(targets[1].begin(), targets[1].end(), keeps(kColumnRadius_m + 0.6));
  };
  for (int attempt = 0; attempt < 40 * kColumns && columns.size() < kColumns; ++attempt) {
    const glm::dvec2 p{snapped_in(random, -10, 10), snapped_in(random, -10, 10)};
    if (is_free(p)) columns.push_back({p});
  }
  return columns;
}

// Plans the walks of the movers one after another. A walk is a row of straight legs to points near the targets, chosen
// so that the mover meets none of those planned before.
class CrowdPlanner {
 public:
  CrowdPlanner(const std::array<Plan, 2>& targets, const std::vector<Column>& columns, const glm::dvec2& eye_m,
               CounterRandom& random)
      : bodies_(targets.begin(), targets.end()), columns_(columns), eye_m_(eye_m), random_(random) {}

  // The mover starts the farther off the more often no walk was found, so that one is found at last.
  TimedPath next() {
    for (double reach_m = kNear_m;; reach_m += 0.25)
      if (try_walk(reach_m)) {
        bodies_.push_back(plan_);
        return {corners_, times_s_};
      }
  }

 private:
  size_t ticks() const { return bodies_[0].size(); }

  bool try_walk(double reach_m) {
    corners_ = {near_targets(0, reach_m)};
    times_s_ = {0};
    plan_ = {corners_[0]};
    if (!is_free(corners_[0], 0)) return false;
    while (plan_.size() < ticks())
      if (!add_leg(reach_m)) return false;
    return true;
  }

  // A random position in a square around the targets' middle.
  glm::dvec2 near_targets(size_t tick, double reach_m) {
    const glm::dvec2 middle = (bodies_[0][tick] + bodies_[1][tick]) / 2.0;
    const double x = snapped_in(random_, -reach_m, reach_m), z = snapped_in(random_, -reach_m, reach_m);
    return middle + glm::dvec2(x, z);
  }

  bool add_leg(double reach_m) {
    for (int attempt = 0; attempt < 40; ++attempt) {
      // A position near where the targets will be in about three seconds.
      const size_t then = std::min(plan_.size() + 30, ticks() - 1);
      const glm::dvec2 to = near_targets(then, reach_m), from = corners_.back();
      const double distance_m = length(to - from);
      const double speed = random_.next_in(kSlowest_mps, kFastest_mps);
      if (distance_m >= 2.5 && try_leg(from, to, std::ceil(distance_m / speed / kTick_s))) return true;
    }
    return false;
  }

  bool try_leg(const glm::dvec2& from, const glm::dvec2& to, double leg_ticks) {
    const size_t before = plan_.size();
    for (double k = 1; k <= leg_ticks && plan_.size() < ticks(); ++k) {
      const glm::dvec2 p = from + (to - from) * (k / leg_ticks);
      if (!is_free(p, plan_.size())) {
        plan_.resize(before);
        return false;
      }
      plan_.push_back(p);
    }
    corners_.push_back(to);
    times_s_.push_back(times_s_.back() + leg_ticks * kTick_s);
    return true;
  }

  bool is_free(const glm::dvec2& p, size_t tick) const {
    const double time_s = static_cast<double>(tick) * kTick_s;
    if (time_s <= kFreeView_s && length(p - eye_m_) < kFreeView_m) return false;
    return std::all_of(bodies_.begin(), bodies_.end(),
                       [&](const Plan& body) { return length(body[tick] - p) >= kApart_m; }) &&
           std::all_of(columns_.begin(), columns_.end(), [&](const Column& c) {
             return length(c.middle_m - p) >= kColumnRadius_m + kBodyRadius_m + 0.2;
           });
  }

  std::vector<Plan> bodies_;  // the two targets, then the movers so far
  const std::vector<Column>& columns_;
  glm::dvec2 eye_m_;
  CounterRandom& random_;
  Polyline corners_;  // of the mover being planned
  std::vector<double> times_s_;
  Plan plan_;
};

void add_plaza(ScenarioBuilder& scene, const std::vector<Column>& columns) {
  scene.add_static("plaza", scene.add_mesh("plaza", standing_box(kPlaza_m, 0.25, kPlaza_m), colors::kFloor),
                   {0, -0.25, 0});
  MeshData column;
  append_frustum(column, {0, 0, 0}, kColumnRadius_m, kColumnRadius_m - 0.0625, 5.0, 20);
  const int mesh = scene.add_mesh("column", column, colors::kStone);
  for (size_t k = 0; k < columns.size(); ++k)
    scene.add_static(numbered("column", static_cast<int>(k) + 1), mesh,
                     {columns[k].middle_m.x, 0, columns[k].middle_m.y});
}

void add_movers(ScenarioBuilder& scene, CrowdPlanner& planner, const CrowdOptions& options) {
  constexpr std::array<double, 3> kHeights_m{1.625, 1.75, 1.875};
  std::array<int, kHeights_m.size()> meshes{};
  for (size_t k = 0; k < meshes.size(); ++k) {
    MeshData body;
    append_capsule(body, {0, 0, 0}, kBodyRadius_m, kHeights_m[k], 12, 3);
    meshes[k] = scene.add_mesh(numbered("mover", static_cast<int>(k)), body, colors::kCar);
  }
  InstanceAttributes attributes;
  attributes.collides = options.movers_collide;
  for (int i = 0; i < options.movers; ++i)
    scene.add_occluder(numbered("mover", i + 1), meshes[static_cast<size_t>(i) % meshes.size()],
                       walk(planner.next(), options.duration_s, kMoverKeysPerSecond), attributes);
}

}  // namespace

std::vector<std::byte> make_crowd(const CrowdOptions& options) {
  assert(options.movers >= 0 && options.movers <= 35);
  CounterRandom walk_random(options.seed, 0, RandomPurpose::kSceneGeneration);
  CounterRandom column_random(options.seed, 1, RandomPurpose::kSceneGeneration);
  CounterRandom mover_random(options.seed, 2, RandomPurpose::kSceneGeneration);
  const Round round = walk_round(options.duration_s, walk_random);
  const auto beside = [&](double side) {
    std::vector<double> distances_m;
    for (size_t k = 0; k < round.corners.size(); ++k) distances_m.push_back(side * walk_random.next_in(0.6, 1.1));
    return TimedPath(parallel(round.corners, distances_m), round.times_s);
  };
  const TimedPath left = beside(1), right = beside(-1);
  const std::array<Plan, 2> targets{plan_of(left, options.duration_s), plan_of(right, options.duration_s)};
  const glm::dvec2 start = round.corners[0], forward = (round.corners[1] - start) / length(round.corners[1] - start);
  const glm::dvec2 eye = start - forward * 5.5;

  const std::vector<Column> columns = place_columns(targets, eye, column_random);
  CrowdPlanner planner(targets, columns, eye, mover_random);
  ScenarioBuilder scene(options.duration_s);
  add_plaza(scene, columns);
  scene.add_camera({eye.x, 1.9, eye.y}, {start.x, 1.2, start.y});
  scene.add_character("target-1", walk(left, options.duration_s));
  scene.add_character("target-2", walk(right, options.duration_s));
  add_movers(scene, planner, options);
  return scene.write();
}

}  // namespace sightline::scenes
