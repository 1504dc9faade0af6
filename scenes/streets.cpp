#include "scenes/streets.h"

#include <algorithm>
#include <cmath>

#include "scenes/exact.h"
#include "scenes/scenario_builder.h"
#include "scenes/shapes.h"
#include "scenes/vehicle_path.h"

namespace sightline::scenes {
namespace {

// Crossings (i, j), 0 to kGrid, are kPitch_m apart; the house of block (i, j) stands between four of them.
constexpr int kGrid = 6;
constexpr double kPitch_m = 75.0;
constexpr double kStreet_m = 15.0;
constexpr double kLane_m = 3.0;     // from the middle of the street to the middle of the right-hand lane
constexpr double kApart_m = 9.0;    // between the target and any other vehicle
constexpr double kBlock_m = 120.0;  // of make_block
constexpr double kBlockHeight_m = 20.0;

using Crossing = glm::ivec2;
constexpr Crossing kSides[] = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}};

bool in_grid(const Crossing& c) {
  return std::min(c.x, c.y) >= 0 && std::max(c.x, c.y) <= kGrid;
}

glm::dvec2 place_of(const Crossing& c) {
  return glm::dvec2(c) * kPitch_m;
}

// Straight on or round a corner, never back; turns are as probable as going straight on.
std::vector<Crossing> choose_crossings(size_t count, CounterRandom& random) {
  std::vector<Crossing> way{{1, 1 + static_cast<int>(random.next_below(kGrid - 1))}};
  size_t side = 0;
  way.push_back(way[0] + kSides[side]);
  while (way.size() < count) {
    std::vector<size_t> choices;
    for (const size_t turn : {0, 0, 1, 3})
      if (in_grid(way.back() + kSides[(side + turn) % 4])) choices.push_back((side + turn) % 4);
    side = choices[random.next_below(static_cast<uint32_t>(choices.size()))];
    way.push_back(way.back() + kSides[side]);
  }
  return way;
}

// Only the crossings at which the way turns, and its ends: a line for drive_along.
Polyline line_of(const std::vector<Crossing>& way) {
  Polyline line;
  for (size_t k = 0; k < way.size(); ++k)
    if (k == 0 || k + 1 == way.size() || way[k + 1] - way[k] != way[k] - way[k - 1]) line.push_back(place_of(way[k]));
  return parallel(line, -kLane_m);
}

void add_houses(ScenarioBuilder& scene, CounterRandom& random) {
  constexpr double kLot_m = (kPitch_m - kStreet_m) / 2;
  std::vector<int> meshes;
  for (const double height : {7.0, 10.0, 14.0, 21.0})
    meshes.push_back(scene.add_mesh(numbered("house", static_cast<int>(meshes.size())),
                                    standing_box(kLot_m - 3, height, kLot_m - 3), colors::kStone));
  int count = 0;
  for (int i = -1; i <= kGrid; ++i)
    for (int j = -1; j <= kGrid; ++j)
      for (int lot = 0; lot < 4; ++lot) {
        if (random.next_below(8) == 0) continue;  // a yard
        const double x = i * kPitch_m + kStreet_m / 2 + (lot % 2 + 0.5) * kLot_m;
        const double z = j * kPitch_m + kStreet_m / 2 + (lot / 2 + 0.5) * kLot_m;
        scene.add_static(numbered("house", ++count), meshes[random.next_below(4)], {x, 0, z});
      }
}

void add_parked(ScenarioBuilder& scene, CounterRandom& random) {
  const int van = scene.add_mesh("parked", vehicle_mesh(5.5, 2.5), colors::kCar);
  for (int k = 0; k < 120; ++k) {
    const double along = snapped_in(random, 0.1, 0.9) + random.next_below(kGrid), line = random.next_below(kGrid + 1);
    const double at = snap(along * kPitch_m),
                 across = snap(line * kPitch_m + (random.next_below(2) == 0 ? 6.25 : -6.25));
    const bool along_x = random.next_below(2) == 0;
    // Not on a crossing, nor where the target starts.
    const double rest = at - std::floor(at / kPitch_m) * kPitch_m;
    if (rest < 14 || rest > kPitch_m - 14) continue;
    const glm::dvec3 p = along_x ? glm::dvec3(at, 0, across) : glm::dvec3(across, 0, at);
    scene.add_static(numbered("parked", k), van, p, quarter_turns(along_x ? 1 : 0));
  }
}

double least_distance_m(const Motion& a, const Motion& b) {
  double least = INFINITY;
  for (size_t k = 0; k < a.positions_m.size(); ++k) {
    const glm::dvec3 d = a.positions_m[k] - b.positions_m[k];
    least = std::min(least, length({d.x, d.z}));
  }
  return least;
}

// Vehicles on straight lines along the streets. One that would come too near the target is left out.
void add_traffic(ScenarioBuilder& scene, int count, const Motion& target, CounterRandom& random) {
  const int mesh = scene.add_mesh("truck", vehicle_mesh(7.0, 3.0), colors::kMetal);
  InstanceAttributes attributes;
  attributes.collides = false;
  for (int k = 0, attempt = 0; k < count && attempt < 20 * count; ++attempt) {
    const double across = random.next_below(kGrid + 1) * kPitch_m, speed = random.next_in(10, 20);
    const bool along_x = random.next_below(2) == 0, forward = random.next_below(2) == 0;
    const double start = snapped_in(random, -200, kGrid * kPitch_m + 200), end = start + (forward ? 1000 : -1000);
    const Polyline street = along_x ? Polyline{{start, across}, {end, across}}
                                    : Polyline{{across, start}, {across, end}};
    const TimedPath path(parallel(street, -kLane_m), {0, 1000 / speed});
    const Motion motion = walk(path, scene.duration_s());
    if (least_distance_m(motion, target) < kApart_m) continue;
    scene.add_occluder(numbered("truck", ++k), mesh, motion, attributes);
  }
}

void add_ground(ScenarioBuilder& scene, double half_m, const glm::dvec2& middle) {
  const int ground = scene.add_mesh("ground", standing_box(2 * half_m, 0.25, 2 * half_m), colors::kFloor);
  scene.add_static("ground", ground, {middle.x, -0.25, middle.y});
}

}  // namespace

std::vector<std::byte> make_street(const StreetOptions& options) {
  CounterRandom way_random(options.seed, 0, RandomPurpose::kSceneGeneration);
  CounterRandom house_random(options.seed, 1, RandomPurpose::kSceneGeneration);
  CounterRandom traffic_random(options.seed, 2, RandomPurpose::kSceneGeneration);
  const double chosen = way_random.next_in(15, 30);
  const double cruise = options.cruise_mps > 0 ? options.cruise_mps : chosen;
  const auto crossings = static_cast<size_t>(std::ceil(options.duration_s * cruise / kPitch_m)) + 3;
  const Polyline line = line_of(choose_crossings(crossings, way_random));
  const Motion drive = walk(drive_along(line, {.cruise_mps = cruise}), options.duration_s);

  ScenarioBuilder scene(options.duration_s);
  add_ground(scene, kGrid * kPitch_m, glm::dvec2(kGrid * kPitch_m / 2));
  add_houses(scene, house_random);
  add_parked(scene, house_random);
  const glm::dvec3 start = drive.positions_m[0];
  scene.add_camera(start + glm::dvec3(-8, 3, 0), start + glm::dvec3(0, 1, 0), {40, 20});
  scene.add_target("car", scene.add_mesh("car", vehicle_mesh(), colors::kBody), drive);
  add_traffic(scene, options.traffic, drive, traffic_random);
  return scene.write();
}

std::vector<std::byte> make_block(const BlockOptions& options) {
  CounterRandom random(options.seed, 0, RandomPurpose::kSceneGeneration);
  const double half = kBlock_m / 2, off = half + 5;
  const bool two_corners = random.next_below(2) == 1;
  const double side = random.next_below(2) == 0 ? 1 : -1;  // mirrored along z
  const double stop = snapped_in(random, -20, 20);
  Polyline line{{-half + 10, off * side}, {off, off * side}, {off, stop * side}};
  if (two_corners) line = {{-half + 10, off * side}, {off, off * side}, {off, -off * side}, {stop, -off * side}};
  const Motion drive = walk(
      drive_along(line, {.cruise_mps = 20, .corner_radius_m = 12, .lateral_mps2 = 50, .stops = true}),
      options.duration_s);
  ScenarioBuilder scene(options.duration_s);
  add_ground(scene, 200, {0, 0});
  const int block = scene.add_mesh("block", standing_box(kBlock_m, kBlockHeight_m, kBlock_m), colors::kStone);
  scene.add_static("block", block, {0, 0, 0});
  const glm::dvec3 start = drive.positions_m[0];
  scene.add_camera(start + glm::dvec3(-8, 3, 0), start + glm::dvec3(0, 1, 0));
  scene.add_target("car", scene.add_mesh("car", vehicle_mesh(), colors::kBody), drive);
  return scene.write();
}

}  // namespace sightline::scenes
