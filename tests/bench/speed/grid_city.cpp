#include "tests/bench/speed/grid_city.h"

#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "server/base/random.h"
#include "server/scene/primitives.h"

namespace sightline::bench {
namespace {

constexpr double kTickS = 1.0 / 60;
constexpr double kBlockSpacingM = 30.0;
constexpr double kWalkMps = 1.5;
constexpr double kTurnBackM = 60.0;
constexpr uint64_t kFirstWalkerId = 1'000'000;

// A failure here is a mistake in the measurement itself.
template <typename T>
T must(Result<T> result) {
  if (!result) std::fprintf(stderr, "%s\n", to_string(result.error()).c_str()), std::abort();
  return std::move(*result);
}
void must(const Status& status) {
  if (!status) std::fprintf(stderr, "%s\n", to_string(status.error()).c_str()), std::abort();
}

// A box with every face cut into n x n cells: 12 n^2 triangles.
MeshData cut_box(const glm::vec3& half, int n) {
  MeshData mesh;
  const uint32_t row = static_cast<uint32_t>(n) + 1;
  for (int axis = 0; axis < 3; ++axis)
    for (const float side : {-1.0f, 1.0f}) {
      const auto base = static_cast<uint32_t>(mesh.positions.size());
      for (uint32_t j = 0; j < row; ++j)
        for (uint32_t i = 0; i < row; ++i) {
          glm::vec3 p;
          p[axis] = side;
          p[(axis + 1) % 3] = -1.0f + 2.0f * static_cast<float>(i) / static_cast<float>(n);
          p[(axis + 2) % 3] = -1.0f + 2.0f * static_cast<float>(j) / static_cast<float>(n);
          mesh.positions.push_back(p * half);
        }
      for (uint32_t j = 0; j + 1 < row; ++j)
        for (uint32_t i = 0; i + 1 < row; ++i) {
          const uint32_t a = base + j * row + i;
          mesh.indices.insert(mesh.indices.end(), {a, a + 1, a + row + 1, a, a + row + 1, a + row});
        }
    }
  return mesh;
}

// Moves back and forth within kTurnBackM of the start.
double walked_m(int tick) {
  const double lap_m = 2 * kTurnBackM, way_m = std::fmod(kWalkMps * kTickS * tick, lap_m);
  return way_m <= kTurnBackM ? way_m : lap_m - way_m;
}

GridCityOptions with_group(GridCityOptions options) {
  options.group = std::max(options.group, options.targets);
  return options;
}

}  // namespace

GridCity::GridCity(const GridCityOptions& options) : options_(with_group(options)) {
  SceneDelta delta;
  add_blocks(delta);
  add_props(delta);
  add_walkers(delta);
  must(mirror_.apply(delta, {}));
  for (int i = 0; i < options_.targets; ++i) {
    Target& target = targets_.emplace_back();
    target.instance_id = kFirstWalkerId + static_cast<uint64_t>(i * options_.group / options_.targets);
    held_tables_.push_back(extents_.get(mirror_.find(target.instance_id)->geometry));
    tables_.push_back(held_tables_.back().get());
  }
  for (int i = 0; i < walkers(); ++i) update_.ids.push_back(kFirstWalkerId + static_cast<uint64_t>(i));
  update_.poses.resize(update_.ids.size());
  update_.velocities_mps.resize(update_.ids.size());
  advance(0);
}

void GridCity::add_blocks(SceneDelta& delta) {
  CounterRandom random(1, 0, RandomPurpose::kTest);
  const int n = options_.blocks_a_side;
  uint64_t id = 1;
  for (int z = 0; z < n; ++z) {
    std::shared_ptr<const Geometry> shared;
    glm::vec3 half{0.0f};
    for (int x = 0; x < n; ++x, ++id) {
      if (options_.own_geometry || !shared) {
        half = {random.next_in(6, 11), random.next_in(5, 30), random.next_in(6, 11)};
        shared = must(store_.intern(cut_box(half, options_.cells)));
      }
      const glm::dvec3 at((x - 0.5 * (n - 1)) * kBlockSpacingM, half.y, (z - 0.5 * (n - 1)) * kBlockSpacingM);
      delta.add.push_back({.id = id, .geometry = shared, .pose = {at}, .attributes = {}});
    }
  }
}

void GridCity::add_props(SceneDelta& delta) {
  if (options_.props == 0) return;
  CounterRandom random(2, 0, RandomPurpose::kTest);
  const auto geometry = must(store_.intern(*tessellate(BoxShape{{0.15f, 0.6f, 0.15f}})));
  const double reach_m = 0.5 * options_.blocks_a_side * kBlockSpacingM;
  for (int i = 0; i < options_.props; ++i) {
    const double street = kBlockSpacingM * std::floor(random.next_in(-reach_m, reach_m) / kBlockSpacingM);
    const double side = random.next_unit() < 0.5 ? -3.5 : 3.5, along = random.next_in(-reach_m, reach_m);
    delta.add.push_back({.id = 100'000 + static_cast<uint64_t>(i),
                         .geometry = geometry,
                         .pose = {{street + side, 0.6, along}},
                         .attributes = {}});
  }
}

void GridCity::add_walkers(SceneDelta& delta) {
  const auto geometry = must(store_.intern(*tessellate(CapsuleShape{0.3f, 0.6f})));
  for (int i = 0; i < walkers(); ++i)
    delta.add.push_back({.id = kFirstWalkerId + static_cast<uint64_t>(i),
                         .geometry = geometry,
                         .pose = walker_pose(i, 0),
                         .attributes = {},
                         .moving = true});
}

// The group walks in rows of four in the street x = 0, the others in all streets and on both sides of them.
Pose GridCity::walker_pose(int walker, int tick) const {
  if (walker < options_.group)
    return {{-1.5 + 1.0 * (walker % 4), 0.9, -0.5 * kTurnBackM + walked_m(tick) - 1.2 * (walker / 4)}};
  CounterRandom random(3, static_cast<uint64_t>(walker), RandomPurpose::kTest);
  const double streets = options_.blocks_a_side - 1;
  const double street = kBlockSpacingM * std::floor(random.next_in(-0.5 * streets, 0.5 * streets + 1));
  const double reach_m = 0.5 * options_.blocks_a_side * kBlockSpacingM;
  const double across = random.next_in(-3, 3), start = random.next_in(-reach_m, reach_m - kTurnBackM);
  const int phase = static_cast<int>(random.next_in(0, 5000));
  return {{street + across, 0.9, start + walked_m(tick + phase)}};
}

double GridCity::advance(int tick) {
  for (size_t i = 0; i < update_.ids.size(); ++i) {
    const int walker = static_cast<int>(i);
    update_.poses[i] = walker_pose(walker, tick);
    update_.velocities_mps[i] = (walker_pose(walker, tick + 1).position_m - update_.poses[i].position_m) * (1 / kTickS);
  }
  const auto begin = std::chrono::steady_clock::now();
  must(mirror_.apply({}, update_));
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
}

Pose GridCity::camera() const {
  const glm::dvec3 at = mirror_.find(targets_[0].instance_id)->pose.position_m;
  const glm::dvec3 from = at + glm::dvec3(0.5, 3.0, -7.0);
  return {from, look_rotation(glm::normalize(at - from), {0, 1, 0}, {1, 0, 0})};
}

size_t GridCity::triangles() const {
  size_t count = 0;
  for (const Instance& instance : mirror_.instances())
    if (instance.geometry) count += instance.geometry->triangle_count();
  return count;
}

}  // namespace sightline::bench
