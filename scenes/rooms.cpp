#include "scenes/rooms.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "scenes/exact.h"
#include "scenes/room_plan.h"
#include "scenes/scenario_builder.h"
#include "scenes/shapes.h"

namespace sightline::scenes {
namespace {

constexpr double kFreeWay_m = 0.7;  // between furniture and the targets' axes

struct Furniture {
  const char* name;
  glm::dvec3 size_m;
};
constexpr std::array<Furniture, 3> kFurniture{
    {{"table", {1.25, 0.75, 0.75}}, {"shelf", {1.0, 2.0, 0.375}}, {"sofa", {1.75, 0.875, 0.875}}}};

// An upright box seen from above.
struct Footprint {
  glm::dvec2 middle_m;
  glm::dvec2 half_m;
  double distance_m(const glm::dvec2& p) const {
    const double dx = std::abs(p.x - middle_m.x) - half_m.x, dz = std::abs(p.y - middle_m.y) - half_m.y;
    return length({std::max(dx, 0.0), std::max(dz, 0.0)});
  }
};

bool is_clear(const Footprint& piece, const std::vector<glm::dvec2>& kept_free_m) {
  return std::all_of(kept_free_m.begin(), kept_free_m.end(),
                     [&](const glm::dvec2& p) { return piece.distance_m(p) >= kFreeWay_m; });
}

void add_furniture(ScenarioBuilder& scene, int tries_per_room, const std::vector<glm::dvec2>& kept_free_m,
                   CounterRandom& random) {
  std::array<int, kFurniture.size()> meshes{};
  for (size_t k = 0; k < meshes.size(); ++k) {
    const glm::dvec3& s = kFurniture[k].size_m;
    meshes[k] = scene.add_mesh(kFurniture[k].name, standing_box(s.x, s.y, s.z), colors::kWood);
  }
  int count = 0;
  for (int room = 0; room < kRooms * kRooms; ++room)
    for (int attempt = 0; attempt < tries_per_room; ++attempt) {
      const size_t kind = random.next_below(kFurniture.size());
      const int turn = static_cast<int>(random.next_below(2));
      const glm::dvec3& size = kFurniture[kind].size_m;
      const glm::dvec2 half = turn == 0 ? glm::dvec2(size.x, size.z) / 2.0 : glm::dvec2(size.z, size.x) / 2.0;
      const glm::dvec2 room_half = glm::dvec2(kRoom_m / 2 - kHalfWall_m - 0.0625) - half;
      const double dx = snapped_in(random, -room_half.x, room_half.x);
      const double dz = snapped_in(random, -room_half.y, room_half.y);
      const Footprint piece{middle_of({room % kRooms, room / kRooms}) + glm::dvec2(dx, dz), half};
      if (!is_clear(piece, kept_free_m)) continue;
      scene.add_static(numbered(kFurniture[kind].name, ++count), meshes[kind],
                       {piece.middle_m.x, 0, piece.middle_m.y}, quarter_turns(turn));
    }
}

// The positions where no furniture may stand: the targets' paths, the doors, the camera's start.
std::vector<glm::dvec2> places_kept_free(const std::array<Motion, 2>& walks, const RoomDoors& doors,
                                         const glm::dvec3& eye_m) {
  std::vector<glm::dvec2> places{{eye_m.x, eye_m.z}};
  for (const Motion& motion : walks)
    for (const glm::dvec3& p : motion.positions_m) places.emplace_back(p.x, p.z);
  for (int i = 0; i < kRooms; ++i)
    for (int j = 0; j < kRooms; ++j) {
      if (i + 1 < kRooms) places.push_back(doors.between({i, j}, {i + 1, j}));
      if (j + 1 < kRooms) places.push_back(doors.between({i, j}, {i, j + 1}));
    }
  return places;
}

}  // namespace

std::vector<std::byte> make_rooms(const RoomsOptions& options) {
  CounterRandom plan_random(options.seed, 0, RandomPurpose::kSceneGeneration);
  CounterRandom furniture_random(options.seed, 1, RandomPurpose::kSceneGeneration);
  const RoomDoors doors(plan_random);
  const Polyline path = path_through(choose_rooms(rooms_within(options.duration_s), plan_random), doors);
  const std::array<Motion, 2> walks{walk(at_even_speed(path, -kFollowing_s), options.duration_s),
                                    walk(at_even_speed(path, 0), options.duration_s)};

  ScenarioBuilder scene(options.duration_s);
  add_room_shell(scene);
  add_inner_walls(scene, doors);
  add_furniture(scene, options.furniture_per_room, places_kept_free(walks, doors, room_eye_m(path)),
                furniture_random);
  add_room_camera(scene, path);
  scene.add_character("target-1", walks[0]);
  scene.add_character("target-2", walks[1]);
  return scene.write();
}

}  // namespace sightline::scenes
