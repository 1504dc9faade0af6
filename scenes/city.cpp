#include "scenes/city.h"

#include <array>

#include "scenes/building.h"
#include "scenes/exact.h"
#include "scenes/scenario_builder.h"
#include "scenes/shapes.h"

namespace sightline::scenes {
namespace {

// Blocks of 4 x 2 lots, 14 m each, between streets 12 m wide: a pavement on each side, a road in the middle.
// Block (bx, bz) starts at (68 bx, 40 bz).
constexpr int kBlocksX = 6, kBlocksZ = 5;
constexpr double kLot_m = 14.0;
constexpr double kStreet_m = 12.0;
constexpr double kBlockX_m = 4 * kLot_m, kBlockZ_m = 2 * kLot_m;
constexpr double kPitchX_m = kBlockX_m + kStreet_m, kPitchZ_m = kBlockZ_m + kStreet_m;
// From the edge of the lots outwards.
constexpr double kKerb_m = 2.75;       // where trees and lamps stand
constexpr double kParking_m = 4.0625;  // the middle of a parked car
constexpr double kWalking_m = 1.375;   // the middle of the pair of targets
constexpr double kHalfGap_m = 0.45;
constexpr double kSpeed_mps = 2.0;
constexpr size_t kTrees = 260, kLamps = 200, kCars = 160;

// Twenty of each.
constexpr std::array<BuildingPlan, 12> kPlans{{{3, 3, 11.0, 3.5},
                                               {4, 3, 10.5, 3.25},
                                               {5, 3, 11.5, 3.25},
                                               {6, 3, 10.0, 3.0},
                                               {3, 4, 12.5, 3.5},
                                               {4, 4, 12.0, 3.25},
                                               {5, 4, 12.5, 3.25},
                                               {7, 2, 10.0, 3.0},
                                               {3, 5, 13.0, 3.75},
                                               {2, 5, 13.0, 4.0},
                                               {2, 3, 9.0, 3.5},
                                               {9, 2, 9.5, 3.0}}};

template <typename T>
void shuffle(std::vector<T>& items, CounterRandom& random) {
  for (size_t i = items.size(); i > 1; --i) std::swap(items[i - 1], items[random.next_below(static_cast<uint32_t>(i))]);
}

glm::dvec2 block_corner(int bx, int bz) {
  return {bx * kPitchX_m, bz * kPitchZ_m};
}

void add_buildings(ScenarioBuilder& scene, CounterRandom& random) {
  std::vector<int> meshes;
  for (size_t k = 0; k < kPlans.size(); ++k) {
    const int mesh = scene.add_mesh(numbered("building", static_cast<int>(k)), make_building(kPlans[k]),
                                    k % 2 == 0 ? colors::kStone : colors::kWall);
    meshes.insert(meshes.end(), kBlocksX * kBlocksZ * 8 / kPlans.size(), mesh);
  }
  shuffle(meshes, random);
  size_t next = 0;
  for (int block = 0; block < kBlocksX * kBlocksZ; ++block)
    for (int lot = 0; lot < 8; ++lot) {
      const glm::dvec2 p = block_corner(block % kBlocksX, block / kBlocksX) +
                           glm::dvec2((lot % 4 + 0.5) * kLot_m, (lot / 4 + 0.5) * kLot_m);
      scene.add_static(numbered("building", static_cast<int>(next)), meshes[next], {p.x, 0, p.y},
                       quarter_turns(static_cast<int>(random.next_below(4))));
      ++next;
    }
}

// A site at the edge of a block: its position, the direction of the street, and the quarter turn that makes an object's
// +z point to the street.
struct Site {
  glm::dvec2 edge_m;
  glm::dvec2 outwards;
  int turn;
};

// 24 around each block, 6 m apart or more.
std::vector<Site> street_sites() {
  std::vector<Site> sites;
  for (int block = 0; block < kBlocksX * kBlocksZ; ++block) {
    const glm::dvec2 corner = block_corner(block % kBlocksX, block / kBlocksX);
    for (int i = 0; i < 8; ++i) {
      const double x = (i + 0.5) * kBlockX_m / 8;
      sites.push_back({corner + glm::dvec2(x, 0), {0, -1}, 2});
      sites.push_back({corner + glm::dvec2(x, kBlockZ_m), {0, 1}, 0});
    }
    for (int i = 0; i < 4; ++i) {
      const double z = (i + 0.5) * kBlockZ_m / 4;
      sites.push_back({corner + glm::dvec2(0, z), {-1, 0}, 3});
      sites.push_back({corner + glm::dvec2(kBlockX_m, z), {1, 0}, 1});
    }
  }
  return sites;
}

MeshData tree_mesh() {
  MeshData mesh;
  append_frustum(mesh, {0, 0, 0}, 0.1875, 0.125, 2.5, 6);
  append_capsule(mesh, {0, 2.25, 0}, 1.25, 3.25, 8, 2);
  return mesh;
}

MeshData lamp_mesh() {
  MeshData mesh;
  append_frustum(mesh, {0, 0, 0}, 0.09375, 0.0625, 5.0, 6);
  append_box(mesh, {-0.125, 5.0, -0.125}, {0.125, 5.125, 0.75});
  return mesh;
}

// Length along x.
MeshData car_mesh(double length_m, double height_m) {
  MeshData mesh;
  append_box(mesh, {-length_m / 2, 0.25, -0.875}, {length_m / 2, 0.5 * height_m, 0.875});
  append_box(mesh, {-0.3 * length_m, 0.5 * height_m, -0.75}, {0.3 * length_m, height_m, 0.75});
  for (double x : {-0.3, 0.3})
    append_box(mesh, {x * length_m - 0.3125, 0, -0.8125}, {x * length_m + 0.3125, 0.25, 0.8125});
  return mesh;
}

void add_street_furniture(ScenarioBuilder& scene, CounterRandom& random) {
  const int tree = scene.add_mesh("tree", tree_mesh(), colors::kLeaf);
  const int lamp = scene.add_mesh("lamp", lamp_mesh(), colors::kMetal);
  const int car = scene.add_mesh("car", car_mesh(4.25, 1.5), colors::kCar);
  std::vector<Site> sites = street_sites();
  shuffle(sites, random);
  size_t next = 0;
  const auto place = [&](const char* name, size_t count, int mesh, double outwards_m) {
    for (size_t k = 0; k < count; ++k, ++next) {
      const glm::dvec2 p = sites[next % sites.size()].edge_m + sites[next % sites.size()].outwards * outwards_m;
      scene.add_static(numbered(name, static_cast<int>(k)), mesh, {p.x, 0, p.y},
                       quarter_turns(sites[next % sites.size()].turn));
    }
  };
  place("tree", kTrees, tree, kKerb_m);
  place("lamp", kLamps, lamp, kKerb_m);
  place("car", kCars, car, kParking_m);  // goes on from the first site again: cars park beside trees, too
}

// Along the north side of block (2, 2), around its corner, and down its east side.
struct Walk {
  Polyline middle;
  std::vector<double> times_s;
};

Walk around_the_corner() {
  const glm::dvec2 block = block_corner(2, 2);
  const glm::dvec2 corner = block + glm::dvec2(kBlockX_m + kWalking_m, -kWalking_m);
  Walk way{{corner - glm::dvec2(20, 0), corner, corner + glm::dvec2(0, 30)}, {0}};
  for (size_t k = 1; k < way.middle.size(); ++k)
    way.times_s.push_back(way.times_s.back() + length(way.middle[k] - way.middle[k - 1]) / kSpeed_mps);
  return way;
}

Motion drive(const glm::dvec3& from_m, const glm::dvec3& to_m, int turn, double duration_s) {
  Motion motion;
  motion.add(0, from_m, quarter_turns(turn));
  motion.add(duration_s, to_m, quarter_turns(turn));
  return motion;
}

// Two vans that drive past: along the first street, and along the second one after the corner.
void add_traffic(ScenarioBuilder& scene, const glm::dvec2& corner, double duration_s, CounterRandom& random) {
  const int van = scene.add_mesh("van", car_mesh(5.5, 2.5), colors::kCar);
  InstanceAttributes attributes;
  attributes.collides = false;            // faster than a camera can evade
  const double reach = 4.0 * duration_s;  // 8 m/s
  const double road_z = corner.y + kWalking_m - kStreet_m / 2, road_x = corner.x - kWalking_m + kStreet_m / 2;
  const double first = corner.x - 12 + snapped_in(random, -4, 4), second = corner.y + 8 + snapped_in(random, -4, 4);
  scene.add_occluder("van-1", van, drive({first - reach, 0, road_z}, {first + reach, 0, road_z}, 0, duration_s),
                     attributes);
  scene.add_occluder("van-2", van, drive({road_x, 0, second + reach}, {road_x, 0, second - reach}, 1, duration_s),
                     attributes);
}

void add_ground(ScenarioBuilder& scene) {
  const double width = kBlocksX * kPitchX_m + 3 * kStreet_m, depth = kBlocksZ * kPitchZ_m + 3 * kStreet_m;
  const int ground = scene.add_mesh("ground", standing_box(width, 0.25, depth), colors::kFloor);
  scene.add_static("ground", ground,
                   {(kBlocksX * kPitchX_m - kStreet_m) / 2, -0.25, (kBlocksZ * kPitchZ_m - kStreet_m) / 2});
}

}  // namespace

std::vector<std::byte> make_city(const CityOptions& options) {
  CounterRandom building_random(options.seed, 0, RandomPurpose::kSceneGeneration);
  CounterRandom street_random(options.seed, 1, RandomPurpose::kSceneGeneration);
  CounterRandom traffic_random(options.seed, 2, RandomPurpose::kSceneGeneration);
  ScenarioBuilder scene(options.duration_s);
  add_ground(scene);
  add_buildings(scene, building_random);
  add_street_furniture(scene, street_random);
  const Walk way = around_the_corner();
  const glm::dvec2 start = way.middle.front();
  scene.add_camera({start.x - 5, 2.25, start.y}, {start.x, 1.2, start.y});
  scene.add_character("target-1", walk({parallel(way.middle, kHalfGap_m), way.times_s}, options.duration_s));
  scene.add_character("target-2", walk({parallel(way.middle, -kHalfGap_m), way.times_s}, options.duration_s));
  add_traffic(scene, way.middle[1], options.duration_s, traffic_random);
  return scene.write();
}

}  // namespace sightline::scenes
