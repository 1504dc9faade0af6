#include "scenes/rooms.h"

#include <array>

#include "scenes/exact.h"
#include "scenes/furniture.h"
#include "scenes/room_plan.h"
#include "scenes/scenario_builder.h"

namespace sightline::scenes {
namespace {

void add_furniture(ScenarioBuilder& scene, int tries_per_room, const std::vector<glm::dvec2>& kept_free_m,
                   CounterRandom& random) {
  Furniture furniture(scene);
  for (int room = 0; room < kRooms * kRooms; ++room)
    for (int attempt = 0; attempt < tries_per_room; ++attempt)
      furniture.try_piece({middle_of({room % kRooms, room / kRooms}), glm::dvec2(kRoom_m / 2 - kHalfWall_m - 0.0625)},
                          kept_free_m, random);
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
  add_furniture(scene, options.furniture_per_room, places_kept_free(walks, doors, room_eye_m(path)), furniture_random);
  add_room_camera(scene, path);
  scene.add_character("target-1", walks[0]);
  scene.add_character("target-2", walks[1]);
  return scene.write();
}

}  // namespace sightline::scenes
