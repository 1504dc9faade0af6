#include "scenes/lift.h"

#include <algorithm>

#include "scenes/exact.h"
#include "scenes/level_walk.h"
#include "scenes/shapes.h"

namespace sightline::scenes {
namespace {

// One storey seen from above, +x to the right, +z up. The galleries are open towards -z.
//
//    z = 2.6      +-----+
//                 |shaft|          x = -1.3 to 1.3; its front has an opening of 1.6 m on every storey
//    z = 0   +----+-- --+----+
//            |    gallery    |     x = -6 to 6
//    z = -7  +...............+
constexpr int kStoreys = 4;
constexpr double kStorey_m = 4.0, kSlab_m = 0.25, kWall_m = 0.2;
constexpr double kHalfGallery_m = 6.0, kGallery_m = 7.0;
constexpr double kHalfShaft_m = 1.3, kShaft_m = 2.6;
constexpr double kHalfOpening_m = 0.8, kOpening_m = 2.3;
constexpr double kHalfCabin_m = 1.2, kCabinHeight_m = 2.5, kCabinWall_m = 0.0625;
constexpr double kCabinZ_m = 1.3;  // the middle of the shaft
constexpr double kLift_mps = 2.0;
constexpr double kWalking_mps = 1.5;
constexpr double kOutside_s = 7.0;  // on a gallery between two rides
constexpr double kBoarding_s = 1.0;

// The height of the cabin, as a path along x.
struct Ride {
  Polyline heights{{0, 0}};
  std::vector<double> times_s{0};
  void hold_until(double time_s) {
    heights.push_back(heights.back());
    times_s.push_back(time_s);
  }
  void ride_to(double height_m) {
    const double seconds = std::max(height_m - heights.back().x, heights.back().x - height_m) / kLift_mps;
    heights.emplace_back(height_m, 0);
    times_s.push_back(times_s.back() + seconds);
  }
};

// The walk on the ground plan, with the same clock.
struct Walker {
  Polyline line;
  std::vector<double> times_s;
  void walk_to(const glm::dvec2& p) {
    times_s.push_back(times_s.back() + length(p - line.back()) / kWalking_mps);
    line.push_back(p);
  }
  void stay(double seconds) {
    times_s.push_back(times_s.back() + seconds);
    line.push_back(line.back());
  }
};

constexpr glm::dvec2 kCabin{0, kCabinZ_m}, kBefore{0, -1.2};

void add_shell(ScenarioBuilder& scene) {
  MeshData slab, walls, shaft;
  append_box(slab, {-kHalfGallery_m, -kSlab_m, -kGallery_m}, {kHalfGallery_m, 0, -kWall_m});
  const double top = kStoreys * kStorey_m;
  append_box(walls, {-kHalfGallery_m - kWall_m, -kSlab_m, -kGallery_m}, {-kHalfGallery_m, top, 0});
  append_box(walls, {kHalfGallery_m, -kSlab_m, -kGallery_m}, {kHalfGallery_m + kWall_m, top, 0});
  append_box(shaft, {-kHalfShaft_m - kWall_m, -kSlab_m, 0}, {-kHalfShaft_m, top, kShaft_m + kWall_m});
  append_box(shaft, {kHalfShaft_m, -kSlab_m, 0}, {kHalfShaft_m + kWall_m, top, kShaft_m + kWall_m});
  append_box(shaft, {-kHalfShaft_m, -kSlab_m, kShaft_m}, {kHalfShaft_m, top, kShaft_m + kWall_m});
  append_box(shaft, {-kHalfShaft_m, -kSlab_m, 0}, {kHalfShaft_m, -0.125, kShaft_m});
  append_box(shaft, {-kHalfShaft_m, top, -kWall_m}, {kHalfShaft_m, top + kSlab_m, kShaft_m + kWall_m});
  for (int k = 0; k < kStoreys; ++k) {
    const double low = k * kStorey_m - (k == 0 ? kSlab_m : 0.0), high = (k + 1) * kStorey_m,
                 lintel = k * kStorey_m + kOpening_m;
    append_box(walls, {-kHalfGallery_m, low, -kWall_m}, {-kHalfOpening_m, high, 0});
    append_box(walls, {kHalfOpening_m, low, -kWall_m}, {kHalfGallery_m, high, 0});
    append_box(walls, {-kHalfOpening_m, lintel, -kWall_m}, {kHalfOpening_m, high, 0});
    append_box(walls, {-kHalfOpening_m, low - (k == 0 ? 0.0 : kSlab_m), -kWall_m}, {kHalfOpening_m, k * kStorey_m, 0});
  }
  const int slab_mesh = scene.add_mesh("slab", slab, colors::kFloor);
  for (int k = 0; k <= kStoreys; ++k) scene.add_static(numbered("slab", k), slab_mesh, {0, k * kStorey_m, 0});
  scene.add_static("walls", scene.add_mesh("walls", walls, colors::kWall), {0, 0, 0});
  scene.add_static("shaft", scene.add_mesh("shaft", shaft, colors::kStone), {0, 0, 0});
  const int ground = scene.add_mesh("ground", standing_box(60, 0.25, 60), colors::kFloor);
  scene.add_static("ground", ground, {0, -0.5, 0});
}

MeshData cabin_mesh() {
  MeshData mesh;
  const double half = kHalfCabin_m, wall = kCabinWall_m, depth = kHalfCabin_m;
  append_box(mesh, {-half, -0.0625, -depth}, {half, 0, depth});
  append_box(mesh, {-half, kCabinHeight_m, -depth}, {half, kCabinHeight_m + wall, depth});
  append_box(mesh, {-half, 0, -depth}, {-half + wall, kCabinHeight_m, depth});
  append_box(mesh, {half - wall, 0, -depth}, {half, kCabinHeight_m, depth});
  append_box(mesh, {-half + wall, 0, depth - wall}, {half - wall, kCabinHeight_m, depth});
  return mesh;
}

// On a gallery: out of the lift, to a place on it and back.
void look_round(Walker& walker, CounterRandom& random) {
  const double came_out_s = walker.times_s.back();
  walker.walk_to(kBefore);
  walker.walk_to({snapped_in(random, -4.5, 4.5), snapped_in(random, -5, -3)});
  walker.walk_to(kBefore);
  walker.stay(std::max(0.5, kOutside_s - (walker.times_s.back() - came_out_s)));
  walker.walk_to(kCabin);
}

Motion riding(const TimedPath& ground, const TimedPath& height, double duration_s) {
  Motion motion = walk(ground, duration_s);
  for (size_t i = 0; i < motion.times_s.size(); ++i)
    motion.positions_m[i] = snap_key(motion.positions_m[i] + glm::dvec3(0, height.position_m(motion.times_s[i]).x, 0));
  return motion;
}

}  // namespace

std::vector<std::byte> make_lift(const LiftOptions& options) {
  CounterRandom random(options.seed, 0, RandomPurpose::kSceneGeneration);
  const int first = 1 + static_cast<int>(random.next_below(kStoreys - 1));
  const int second = (first + 1 + static_cast<int>(random.next_below(kStoreys - 1))) % kStoreys;
  Walker walker{{{snapped_in(random, -1, 1), -3.5}}, {0}};
  Ride ride;
  walker.walk_to(kBefore);
  walker.walk_to(kCabin);
  for (const int storey : {first, second}) {
    walker.stay(kBoarding_s);
    ride.hold_until(walker.times_s.back());
    ride.ride_to(storey * kStorey_m);
    walker.stay(ride.times_s.back() - walker.times_s.back() + kBoarding_s);
    look_round(walker, random);
  }
  walker.walk_to(kBefore);
  walker.walk_to({2.0, -4.0});
  walker.stay(1);
  ride.hold_until(walker.times_s.back());
  const TimedPath height(ride.heights, ride.times_s);

  ScenarioBuilder scene(options.duration_s);
  add_shell(scene);
  scene.add_camera({walker.line[0].x, 2.0, -6.5}, {walker.line[0].x, 1.1, -3.5});
  scene.add_character("target-1", riding({walker.line, walker.times_s}, height, options.duration_s));
  Motion cabin;
  const auto last = static_cast<int>(options.duration_s * kKeysPerSecond + 0.5);
  for (int i = 0; i <= last; ++i)
    cabin.add(i / kKeysPerSecond, {kCabin.x, height.position_m(i / kKeysPerSecond).x, kCabin.y}, quarter_turns(0));
  scene.add_occluder("cabin", scene.add_mesh("cabin", cabin_mesh(), colors::kMetal), cabin, {});
  return scene.write();
}

}  // namespace sightline::scenes
