#include "scenes/roofs.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "scenes/exact.h"
#include "scenes/furniture.h"
#include "scenes/scenario_builder.h"
#include "scenes/shapes.h"

namespace sightline::scenes {
namespace {

constexpr std::array<double, 4> kCeilings_m{2.5, 2.75, 3.25, 4.0};
constexpr int kGaps = 8;
constexpr double kLeastGap_m = 1.5, kGapStep_m = 0.5;
constexpr double kWall_m = 0.25;
// A person's middle must be so much farther from the middle of the picture, as a share of the distance from the camera,
// than the picture ends (0.65 at the sides of a picture of 16:9 and 40 degrees).
constexpr double kPictureShare = 0.55;
constexpr double kEye_m = 2.0, kLook_m = 1.0;  // heights of the camera and of what it looks at
constexpr double kBehindCamera_m = 1.0;
constexpr double kLeg_s = 4.0, kWalking_mps = 1.0;  // of the people's middle
constexpr double kWandering_m = 4.0;                // of the people's middle, to each side
constexpr double kCorridor_m = 3.0, kBesideAxis_m = 0.6;
constexpr int kFurniturePerRoom = 14;

struct Scale {
  double gap_m, ceiling_m;
};
Scale scale_of(const RoofsOptions& options) {
  const auto seed = static_cast<size_t>((options.seed + kGaps - 1) % kGaps);
  return {options.gap_m > 0 ? options.gap_m : kLeastGap_m + kGapStep_m * static_cast<double>(seed),
          options.ceiling_m > 0 ? options.ceiling_m
                                : kCeilings_m[(seed + static_cast<size_t>(options.people)) % kCeilings_m.size()]};
}

// The radius of the regular polygon of `people` corners, `gap_m` apart.
double ring_m(int people, double gap_m) {
  constexpr std::array<double, 3> kPerGap{0.5, 0.5773502691896258, 0.7071067811865476};
  return gap_m * kPerGap[static_cast<size_t>(people - 2)];
}
double camera_distance_m(double radius_m) {
  return (radius_m + kBodyRadius_m + 0.2) / kPictureShare;
}

Motion stand(const glm::dvec2& place_m, const glm::dvec2& towards_m, double duration_s) {
  const glm::dvec2 way = towards_m - place_m;
  Motion motion;
  for (const double time_s : {0.0, duration_s})
    motion.add(time_s, {place_m.x, 0, place_m.y}, facing(way / length(way)));
  return motion;
}

// The first turn of the polygon, so that nobody is right behind another as seen from +z.
double first_turn(int people, CounterRandom& random) {
  const double aside = random.next_in(-0.04, 0.04);
  return people == 2 ? 2 * aside : people == 3 ? 0.07 + aside : 0.07 + aside / 2;
}

std::vector<Motion> standing(const RoofsOptions& options, double radius_m, CounterRandom& random) {
  std::vector<Motion> motions;
  const double turn = first_turn(options.people, random);
  for (int k = 0; k < options.people; ++k)
    motions.push_back(
        stand(circle_point(turn + static_cast<double>(k) / options.people) * radius_m, {0, 0}, options.duration_s));
  return motions;
}

// The polygon turns, grows and shrinks while its middle wanders, and nobody keeps quite to it.
std::vector<Motion> walking(const RoofsOptions& options, double radius_m, CounterRandom& random) {
  double turn = first_turn(options.people, random);
  std::vector<Polyline> ways(static_cast<size_t>(options.people));
  std::vector<double> times_s;
  glm::dvec2 middle{0, 0};
  for (double time_s = 0; time_s < options.duration_s + kLeg_s; time_s += kLeg_s) {
    const double scale = times_s.empty() ? 1.0 : random.next_in(0.85, 1.15);
    for (int k = 0; k < options.people; ++k) {
      const glm::dvec2 own = times_s.empty() ? glm::dvec2(0.0) : circle_point(random.next_unit()) * (0.15 * radius_m);
      ways[static_cast<size_t>(k)].push_back(
          middle + circle_point(turn + static_cast<double>(k) / options.people) * (radius_m * scale) + own);
    }
    times_s.push_back(time_s);
    turn += random.next_in(-0.15, 0.15);
    const glm::dvec2 way = circle_point(random.next_unit()) * (kWalking_mps * kLeg_s);
    middle = glm::clamp(middle + way, glm::dvec2(-kWandering_m), glm::dvec2(kWandering_m));
  }
  std::vector<Motion> motions;
  for (const Polyline& way : ways) motions.push_back(walk(TimedPath(way, times_s), options.duration_s));
  return motions;
}

void add_shell(ScenarioBuilder& scene, const glm::dvec2& half_m, const glm::dvec2& middle_m, double ceiling_m) {
  MeshData walls, slab;
  const glm::dvec2 low = middle_m - half_m, high = middle_m + half_m;
  append_box(walls, {low.x - kWall_m, 0, low.y - kWall_m}, {low.x, ceiling_m, high.y + kWall_m});
  append_box(walls, {high.x, 0, low.y - kWall_m}, {high.x + kWall_m, ceiling_m, high.y + kWall_m});
  append_box(walls, {low.x, 0, low.y - kWall_m}, {high.x, ceiling_m, low.y});
  append_box(walls, {low.x, 0, high.y}, {high.x, ceiling_m, high.y + kWall_m});
  append_box(slab, {low.x - kWall_m, 0, low.y - kWall_m}, {high.x + kWall_m, kWall_m, high.y + kWall_m});
  const int slab_mesh = scene.add_mesh("slab", slab, colors::kFloor);
  scene.add_static("walls", scene.add_mesh("walls", walls, colors::kWall), {0, 0, 0});
  scene.add_static("floor", slab_mesh, {0, -kWall_m, 0});
  scene.add_static("ceiling", slab_mesh, {0, ceiling_m, 0});
}

void add_people(ScenarioBuilder& scene, const std::vector<Motion>& motions) {
  for (size_t k = 0; k < motions.size(); ++k)
    scene.add_character(numbered("target", static_cast<int>(k) + 1), motions[k]);
}

double eye_height_m(double ceiling_m) {
  return std::min(kEye_m, ceiling_m - 0.5);
}

std::vector<std::byte> make_room(const RoofsOptions& options) {
  CounterRandom random(options.seed, 0, RandomPurpose::kSceneGeneration),
      furniture_random(options.seed, 1, RandomPurpose::kSceneGeneration);
  const Scale scale = scale_of(options);
  const double radius_m = ring_m(options.people, scale.gap_m), distance_m = camera_distance_m(radius_m);
  const std::vector<Motion> motions = options.walk ? walking(options, radius_m, random)
                                                   : standing(options, radius_m, random);
  const double half_m = snap(distance_m + kBehindCamera_m + (options.walk ? kWandering_m : 0.0));

  ScenarioBuilder scene(options.duration_s);
  add_shell(scene, glm::dvec2(half_m), {0, 0}, scale.ceiling_m);
  std::vector<glm::dvec2> kept_free_m{{0, distance_m}};
  for (const Motion& motion : motions)
    for (const glm::dvec3& p : motion.positions_m) kept_free_m.emplace_back(p.x, p.z);
  // nothing stands before the first picture
  for (int k = 0; k <= 10; ++k) kept_free_m.emplace_back(0, distance_m * k / 10);
  Furniture furniture(scene);
  for (int attempt = 0; attempt < kFurniturePerRoom; ++attempt)
    furniture.try_piece({{0, 0}, glm::dvec2(half_m - 0.0625)}, kept_free_m, furniture_random);
  scene.add_camera({0, eye_height_m(scale.ceiling_m), distance_m}, {0, kLook_m, 0});
  add_people(scene, motions);
  return scene.write();
}

// The corridor runs along +x. One person is on its left, the other on its right, so that a camera behind both sees
// both.
std::vector<std::byte> make_corridor(const RoofsOptions& options) {
  CounterRandom random(options.seed, 0, RandomPurpose::kSceneGeneration);
  const Scale scale = scale_of(options);
  const double distance_m = snap(std::max(3.0, camera_distance_m(kBesideAxis_m)));
  const double side_m = random.next_below(2) == 0 ? kBesideAxis_m : -kBesideAxis_m;
  const double way_m = options.walk ? kWalking_mps * options.duration_s : 0.0;
  std::vector<Motion> motions;
  for (const double sign : {1.0, -1.0}) {
    const glm::dvec2 at{sign > 0 ? scale.gap_m : 0.0, sign * side_m};
    const TimedPath path({at, at + glm::dvec2(kWalking_mps * (options.duration_s + 1), 0)},
                         {0, options.duration_s + 1});
    motions.push_back(options.walk ? walk(path, options.duration_s) : stand(at, {at.x + 1, at.y}, options.duration_s));
  }
  ScenarioBuilder scene(options.duration_s);
  const double low_m = -distance_m - 2, high_m = scale.gap_m + way_m + distance_m + 2;
  add_shell(scene, {snap((high_m - low_m) / 2), kCorridor_m / 2}, {snap((high_m + low_m) / 2), 0}, scale.ceiling_m);
  scene.add_camera({-distance_m, eye_height_m(scale.ceiling_m), 0}, {scale.gap_m / 2, kLook_m, 0});
  add_people(scene, motions);
  return scene.write();
}

}  // namespace

std::vector<std::byte> make_roofs(const RoofsOptions& options) {
  return options.corridor ? make_corridor(options) : make_room(options);
}

}  // namespace sightline::scenes
