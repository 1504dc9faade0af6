#include "scenes/maze.h"

#include <algorithm>

#include "scenes/exact.h"
#include "scenes/level_plan.h"
#include "scenes/scenario_builder.h"
#include "scenes/shapes.h"

namespace sightline::scenes {
namespace {

constexpr int kCells = 11;
constexpr double kCell_m = 2.5;
constexpr double kWall_m = 0.1875;  // thick
constexpr double kHeight_m = 2.5;
constexpr double kFollowing_s = 0.8;

using Way = std::vector<LevelRoom>;

glm::dvec2 middle_of(const LevelRoom& cell) {
  return {(cell.i + 0.5) * kCell_m, (cell.j + 0.5) * kCell_m};
}

// The longest way that begins at `from` and never turns back. In a tree that is depth-first search.
Way longest_from(const LevelPlan& plan, const LevelRoom& from) {
  Way longest, way{from};
  const auto search = [&](const auto& self) -> void {
    if (way.size() > longest.size()) longest = way;
    for (const LevelRoom& next : plan.reachable(way.back())) {
      if (way.size() > 1 && next == way[way.size() - 2]) continue;
      way.push_back(next);
      self(self);
      way.pop_back();
    }
  };
  search(search);
  return longest;
}

bool begins_straight(const Way& way) {
  return middle_of(way[1]) - middle_of(way[0]) == middle_of(way[2]) - middle_of(way[1]);
}

// Between the two cells that are farthest from each other, from the first straight piece on.
Way longest_way(const LevelPlan& plan) {
  Way way = longest_from(plan, longest_from(plan, {0, 0}).back());
  while (way.size() > 3 && !begins_straight(way)) way.erase(way.begin());
  return way;
}

void add_walls(ScenarioBuilder& scene, const LevelPlan& plan) {
  const int wall = scene.add_mesh("wall", standing_box(kCell_m + kWall_m, kHeight_m, kWall_m), colors::kLeaf);
  int count = 0;
  const auto put = [&](const LevelRoom& cell, const LevelRoom& other) {
    const glm::dvec2 p = (middle_of(cell) + middle_of(other)) / 2.0;
    scene.add_static(numbered("wall", ++count), wall, {p.x, 0, p.y}, quarter_turns(cell.i != other.i ? 1 : 0));
  };
  for (const LevelRoom& cell : plan.rooms())
    for (const LevelRoom& other : {LevelRoom{cell.i + 1, cell.j}, LevelRoom{cell.i, cell.j + 1},
                                   LevelRoom{cell.i - 1, cell.j}, LevelRoom{cell.i, cell.j - 1}}) {
      const bool outside = std::min(other.i, other.j) < 0 || std::max(other.i, other.j) >= kCells;
      const bool counted = other.i + other.j > cell.i + cell.j;
      if (outside || (counted && !plan.is_open(cell, other))) put(cell, other);
    }
}

void add_slabs(ScenarioBuilder& scene, bool roofed) {
  const double size = kCells * kCell_m + 1;
  const int slab = scene.add_mesh("slab", standing_box(size, 0.25, size), colors::kFloor);
  const double middle = kCells * kCell_m / 2;
  scene.add_static("floor", slab, {middle, -0.25, middle});
  if (roofed) scene.add_static("ceiling", slab, {middle, kHeight_m, middle});
}

}  // namespace

std::vector<std::byte> make_maze(const MazeOptions& options) {
  CounterRandom plan_random(options.seed, 0, RandomPurpose::kSceneGeneration);
  CounterRandom walk_random(options.seed, 1, RandomPurpose::kSceneGeneration);
  LevelPlan plan(kCells, kCells, 1, plan_random);
  plan.open_tree(plan_random);
  const Way way = longest_way(plan);
  const double speed = walk_random.next_in(1.5, 2.0);
  const glm::dvec2 first = middle_of(way[0]), forward = (middle_of(way[1]) - first) / kCell_m;
  Polyline line{middle_of(way[1])};  // where the last target starts; the camera starts in the cell before
  for (size_t k = 2; k < way.size(); ++k) line.push_back(middle_of(way[k]));

  ScenarioBuilder scene(options.duration_s);
  add_slabs(scene, options.roofed);
  add_walls(scene, plan);
  scene.add_camera({first.x - forward.x * 0.5, 1.8, first.y - forward.y * 0.5}, {line[0].x, 1.2, line[0].y});
  for (int k = 0; k < options.targets; ++k) {
    Polyline own(line.begin(), line.end() - k);  // those behind stop before those in front
    std::vector<double> times_s{-kFollowing_s * (options.targets - 1 - k)};
    for (size_t c = 1; c < own.size(); ++c) times_s.push_back(times_s.back() + length(own[c] - own[c - 1]) / speed);
    own.push_back(own.back());
    times_s.push_back(times_s.back() + 1);
    scene.add_character(numbered("target", k + 1), walk({own, times_s}, options.duration_s));
  }
  return scene.write();
}

}  // namespace sightline::scenes
