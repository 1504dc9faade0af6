#include "scenes/forest.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "scenes/exact.h"
#include "scenes/scenario_builder.h"
#include "scenes/shapes.h"

namespace sightline::scenes {
namespace {

constexpr double kSlowest_mps = 1.5;  // of the faster of the two
constexpr double kFastest_mps = 2.1;
constexpr double kSteepest_turns = 0.17;  // of the way against +x: it winds, and never meets itself
constexpr double kSharpest_turns = 0.15;  // from one leg to the next
constexpr double kStraightest_turns = 0.06;
constexpr double kNearest_m = 0.6;  // each target from the middle of the pair
constexpr double kFarthest_m = 2.0;
constexpr double kFreeWay_m = 0.15;      // between a body and a trunk or low crown
constexpr double kFreeView_m = 3.0;      // around the camera's start
constexpr double kForestDepth_m = 14.0;  // to each side of the way
constexpr double kHighCrown_m = 2.25;    // crowns that begin here hang over the path

// A tree's trunk, and its crown: a cone or, where it ends rounded, a capsule. A crown begins `crown_foot_m`
// above the ground.
struct TreePlan {
  double trunk_radius_m;
  double trunk_height_m;
  double crown_radius_m;
  double crown_foot_m;
  double crown_height_m;
  bool is_cone;

  // The radius around the tree's axis that nothing may pass through.
  double body_radius_m() const { return crown_foot_m < kHighCrown_m ? crown_radius_m : trunk_radius_m; }
};
constexpr std::array<TreePlan, 4> kHighTrees{{{0.25, 4.5, 1.5, 2.5, 4.0, false},
                                              {0.375, 5.5, 1.875, 3.0, 4.5, false},
                                              {0.5, 6.5, 2.125, 3.75, 5.0, false},
                                              {0.1875, 4.0, 1.25, 2.25, 5.5, true}}};
constexpr std::array<TreePlan, 2> kLowTrees{
    {{0.125, 1.0, 0.8125, 0.5, 3.5, true}, {0.1875, 1.0, 0.6875, 0.375, 2.5, false}}};

// The path of the pair's middle.
Polyline wind(double length_m, CounterRandom& random) {
  Polyline way{{0.0, 0.0}};
  double heading_turns = 0;
  while (length(way) < length_m) {
    way.push_back(way.back() + circle_point(heading_turns) * random.next_in(3.0, 5.0));
    // Turns to the other side of +x more often than not, so that the path winds.
    const double bend_turns = random.next_in(kStraightest_turns, kSharpest_turns);
    const bool to_left = random.next_unit() < (heading_turns > 0 ? 0.75 : 0.25);
    heading_turns = std::clamp(heading_turns + (to_left ? -bend_turns : bend_turns), -kSteepest_turns, kSteepest_turns);
  }
  return way;
}

// An offset to the left (side 1) or right (-1) of the path, at a distance that changes from corner to corner.
Polyline beside(const Polyline& way, double side, CounterRandom& random) {
  std::vector<double> distances_m;
  for (size_t k = 0; k < way.size(); ++k) distances_m.push_back(side * random.next_in(kNearest_m, kFarthest_m));
  return parallel(way, distances_m);
}

// The time at which both pass each corner: the longer leg sets the pace.
std::vector<double> paces_s(const Polyline& left, const Polyline& right, CounterRandom& random) {
  std::vector<double> times_s{0};
  for (size_t k = 1; k < left.size(); ++k) {
    const double longer_m = std::max(length(left[k] - left[k - 1]), length(right[k] - right[k - 1]));
    times_s.push_back(times_s.back() + longer_m / random.next_in(kSlowest_mps, kFastest_mps));
  }
  return times_s;
}

std::array<Motion, 2> walk_in_forest(double duration_s, CounterRandom& random) {
  const Polyline way = wind((duration_s + 1) * kFastest_mps, random);
  const Polyline left = beside(way, 1, random), right = beside(way, -1, random);
  const std::vector<double> times_s = paces_s(left, right, random);
  return {walk({left, times_s}, duration_s), walk({right, times_s}, duration_s)};
}

double distance_m(const Motion& motion, const glm::dvec2& p) {
  double least_m = 1e9;
  for (const glm::dvec3& at : motion.positions_m) least_m = std::min(least_m, length({at.x - p.x, at.z - p.y}));
  return least_m;
}

class Planter {
 public:
  explicit Planter(ScenarioBuilder& scene) : scene_(scene) {
    for (const auto& tree : kHighTrees) add_meshes(tree);
    for (const auto& tree : kLowTrees) add_meshes(tree);
  }

  // `kind`: first the high trees, then the low ones.
  void plant(size_t kind, const glm::dvec2& p, double turns) {
    InstanceAttributes passable;
    passable.collides = false;
    ++count_;
    const glm::dquat turn = facing(circle_point(turns));
    scene_.add_static(numbered("trunk", count_), meshes_[2 * kind], {p.x, 0, p.y}, turn);
    scene_.add_static(numbered("crown", count_), meshes_[2 * kind + 1], {p.x, 0, p.y}, turn, passable);
  }

 private:
  void add_meshes(const TreePlan& tree) {
    MeshData trunk, crown;
    append_frustum(trunk, {0, 0, 0}, tree.trunk_radius_m, tree.trunk_radius_m * 0.75, tree.trunk_height_m, 10);
    if (tree.is_cone)
      append_frustum(crown, {0, tree.crown_foot_m, 0}, tree.crown_radius_m, 0, tree.crown_height_m, 10);
    else
      append_capsule(crown, {0, tree.crown_foot_m, 0}, tree.crown_radius_m,
                     std::max(tree.crown_height_m, 2 * tree.crown_radius_m), 10, 3);
    const auto number = static_cast<int>(meshes_.size() / 2);
    meshes_.push_back(scene_.add_mesh(numbered("trunk", number), trunk, colors::kWood));
    meshes_.push_back(scene_.add_mesh(numbered("crown", number), crown, colors::kLeaf));
  }

  ScenarioBuilder& scene_;
  std::vector<int> meshes_;  // trunk and crown of each plan
  int count_ = 0;
};

const TreePlan& plan_of(size_t kind) {
  return kind < kHighTrees.size() ? kHighTrees[kind] : kLowTrees[kind - kHighTrees.size()];
}

struct Bounds {
  glm::dvec2 low{0.0};
  glm::dvec2 high{0.0};
};

Bounds ground_of(const std::array<Motion, 2>& walks) {
  Bounds bounds;
  for (const Motion& motion : walks)
    for (const glm::dvec3& p : motion.positions_m) {
      bounds.low = glm::min(bounds.low, glm::dvec2(p.x, p.z));
      bounds.high = glm::max(bounds.high, glm::dvec2(p.x, p.z));
    }
  const double margin_m = kForestDepth_m + 4;
  return {glm::floor(bounds.low - margin_m), glm::ceil(bounds.high + margin_m)};
}

// Plants one tree in each cell of a square grid, anywhere in the cell, unless it would block a path or is far from all
// of them.
void add_trees(ScenarioBuilder& scene, const std::array<Motion, 2>& walks, const glm::dvec2& eye_m,
               const ForestOptions& options, CounterRandom& random) {
  Planter planter(scene);
  const Bounds ground = ground_of(walks);
  for (double x = ground.low.x; x < ground.high.x; x += options.spacing_m)
    for (double z = ground.low.y; z < ground.high.y; z += options.spacing_m) {
      const bool low = random.next_unit() < options.low_share;
      const size_t kind = low ? kHighTrees.size() + random.next_below(kLowTrees.size())
                              : random.next_below(kHighTrees.size());
      const glm::dvec2 p{x + snapped_in(random, 0, options.spacing_m), z + snapped_in(random, 0, options.spacing_m)};
      const double turns = random.next_in(0, 1);
      const double to_way_m = std::min(distance_m(walks[0], p), distance_m(walks[1], p));
      const bool in_the_way = to_way_m < plan_of(kind).body_radius_m() + kBodyRadius_m + kFreeWay_m;
      if (in_the_way || to_way_m > kForestDepth_m || length(p - eye_m) < kFreeView_m) continue;
      planter.plant(kind, p, turns);
    }
}

void add_ground(ScenarioBuilder& scene, const std::array<Motion, 2>& walks) {
  const Bounds ground = ground_of(walks);
  const glm::dvec2 size = ground.high - ground.low, middle = (ground.low + ground.high) / 2.0;
  scene.add_static("ground", scene.add_mesh("ground", standing_box(size.x, 0.25, size.y), colors::kFloor),
                   {middle.x, -0.25, middle.y});
}

}  // namespace

std::vector<std::byte> make_forest(const ForestOptions& options) {
  CounterRandom way_random(options.seed, 0, RandomPurpose::kSceneGeneration);
  CounterRandom tree_random(options.seed, 1, RandomPurpose::kSceneGeneration);
  const std::array<Motion, 2> walks = walk_in_forest(options.duration_s, way_random);

  ScenarioBuilder scene(options.duration_s);
  add_ground(scene, walks);
  const glm::dvec3 eye{-5, 2.0, 0};
  add_trees(scene, walks, {eye.x, eye.z}, options, tree_random);
  scene.add_camera(eye, {0, 1.2, 0});
  scene.add_character("target-1", walks[0]);
  scene.add_character("target-2", walks[1]);
  return scene.write();
}

}  // namespace sightline::scenes
