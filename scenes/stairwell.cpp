#include "scenes/stairwell.h"

#include "scenes/exact.h"
#include "scenes/level_walk.h"
#include "scenes/shapes.h"

namespace sightline::scenes {
namespace {

// Seen from above, +x to the right, +z up; even flights lead towards +z, odd ones back. In half of the seeds x is
// mirrored.
//
//    z = 3.9  +-----------------+
//             |  half landing   |
//    z = 2.4  +------+   +------+
//             | odd  |gap| even |   x = -1.8 to -0.4 and 0.4 to 1.8
//    z = 0    +------+   +------+
//             |    landing      |
//    z = -1.5 +-----------------+
//             |  lobby (below)  |
//    z = -6   +-----------------+
constexpr int kFlights = 8;  // two a storey
constexpr int kSteps = 8;
constexpr double kRise_m = 0.2, kTread_m = 0.3;
constexpr double kFlight_m = kSteps * kTread_m, kFlightRise_m = kSteps * kRise_m;
constexpr double kHalfShaft_m = 1.8, kHalfGap_m = 0.4, kMiddle_m = 1.1;
constexpr double kLanding_m = 1.5, kSlab_m = 0.2, kWall_m = 0.2;
constexpr double kLobbyEnd_m = -6.0, kLobby_m = 3.0;
constexpr double kTop_m = kFlights * kFlightRise_m + 2.8;
// The walk keeps this far above the line of the edges, so that the walker's lower end clears them.
constexpr double kOverEdges_m = 0.09;

double side_of(int flight) {
  return flight % 2 == 0 ? 1.0 : -1.0;
}

// From the foot of an even flight towards +z; of an odd one from the other landing back.
double along(int flight, double from_foot_m) {
  return flight % 2 == 0 ? from_foot_m : kFlight_m - from_foot_m;
}

void add_flight(MeshData& mesh, int flight, double mirror) {
  const double base = flight * kFlightRise_m;
  for (int k = 0; k < kSteps; ++k) {
    const double z0 = along(flight, k * kTread_m), z1 = along(flight, (k + 1) * kTread_m),
                 top = base + (k + 1) * kRise_m;
    const double x0 = mirror * side_of(flight) * kHalfGap_m, x1 = mirror * side_of(flight) * kHalfShaft_m;
    append_box(mesh, {std::min(x0, x1), top - kRise_m - kSlab_m, std::min(z0, z1)},
               {std::max(x0, x1), top, std::max(z0, z1)});
  }
}

void add_landings(MeshData& mesh) {
  for (int flight = 1; flight <= kFlights; ++flight) {
    const double y = flight * kFlightRise_m, z = flight % 2 == 1 ? kFlight_m : -kLanding_m;
    append_box(mesh, {-kHalfShaft_m, y - kSlab_m, z}, {kHalfShaft_m, y, z + kLanding_m});
  }
}

void add_shell(ScenarioBuilder& scene) {
  const double low = -kLanding_m, high = kFlight_m + kLanding_m, out = kHalfShaft_m + kWall_m;
  MeshData walls, floor;
  append_box(floor, {-out, -0.25, kLobbyEnd_m - kWall_m}, {out, 0, high + kWall_m});
  append_box(walls, {-out, 0, kLobbyEnd_m - kWall_m}, {-kHalfShaft_m, kTop_m, high + kWall_m});
  append_box(walls, {kHalfShaft_m, 0, kLobbyEnd_m - kWall_m}, {out, kTop_m, high + kWall_m});
  append_box(walls, {-kHalfShaft_m, 0, high}, {kHalfShaft_m, kTop_m, high + kWall_m});
  append_box(walls, {-kHalfShaft_m, 0, kLobbyEnd_m - kWall_m}, {kHalfShaft_m, kLobby_m, kLobbyEnd_m});
  append_box(walls, {-kHalfShaft_m, kLobby_m, low - kWall_m}, {kHalfShaft_m, kTop_m, low});
  append_box(walls, {-kHalfShaft_m, kLobby_m, kLobbyEnd_m - kWall_m},
             {kHalfShaft_m, kLobby_m + kWall_m, low - kWall_m});
  append_box(walls, {-out, kTop_m, low - kWall_m}, {out, kTop_m + kWall_m, high + kWall_m});
  scene.add_static("floor", scene.add_mesh("floor", floor, colors::kFloor), {0, 0, 0});
  scene.add_static("walls", scene.add_mesh("walls", walls, colors::kWall), {0, 0, 0});
}

LevelPath path_up(double mirror) {
  LevelPath path;
  const auto add = [&](double x, double z, double height_m) {
    path.corners.emplace_back(mirror * x, z);
    path.heights_m.push_back(height_m);
  };
  constexpr double kSlope = kRise_m / kTread_m;
  add(kMiddle_m, -3.0, 0);
  for (int flight = 0; flight < kFlights; ++flight) {
    const double x = side_of(flight) * kMiddle_m, base = flight * kFlightRise_m, top = base + kFlightRise_m;
    add(x, along(flight, -(kRise_m + kOverEdges_m) / kSlope), base);
    add(x, along(flight, kFlight_m - kTread_m), top + kOverEdges_m);
    add(x, along(flight, kFlight_m + 0.2), top);
    add(x, along(flight, kFlight_m + 0.75), top);
    if (flight + 1 < kFlights) add(-x, along(flight, kFlight_m + 0.75), top);
  }
  add(0, -0.75, kFlights * kFlightRise_m);  // on the uppermost landing
  add(0, -0.75, kFlights * kFlightRise_m);  // where it stays
  return path;
}

}  // namespace

std::vector<std::byte> make_stairwell(const StairwellOptions& options) {
  CounterRandom random(options.seed, 0, RandomPurpose::kSceneGeneration);
  const double mirror = random.next_below(2) == 0 ? 1 : -1, speed = random.next_in(1.3, 1.7);
  const LevelPath path = path_up(mirror);
  std::vector<double> times_s = even_times_s(path, speed, 0);
  times_s.back() += 1;
  ScenarioBuilder scene(options.duration_s);
  add_shell(scene);
  MeshData stairs;
  for (int flight = 0; flight < kFlights; ++flight) add_flight(stairs, flight, mirror);
  add_landings(stairs);
  scene.add_static("stairs", scene.add_mesh("stairs", stairs, colors::kStone), {0, 0, 0});
  const glm::dvec2 start = path.corners[0];
  scene.add_camera({start.x, 1.9, start.y - 2.4}, {start.x, 1.1, start.y});
  scene.add_character("target-1", walk_one(path, times_s, options.duration_s));
  return scene.write();
}

}  // namespace sightline::scenes
