// The floor plan and the walk that the scenes `rooms` and `doors` share: nine rooms, three by three, with a door in
// every wall between two of them.
#pragma once

#include <glm/glm.hpp>
#include <vector>

#include "scenes/path.h"
#include "scenes/scenario_builder.h"
#include "server/base/random.h"

namespace sightline::scenes {

// Room (i, j) covers [6 i, 6 i + 6] x [6 j, 6 j + 6] in x and z, measured to the middle of its walls.
inline constexpr int kRooms = 3;
inline constexpr double kRoom_m = 6.0;
inline constexpr double kHalfWall_m = 0.1;
inline constexpr double kWallHeight_m = 3.0;
inline constexpr double kHalfDoor_m = 0.6;
inline constexpr double kDoorHeight_m = 2.2;
inline constexpr double kThreshold_m = 1.0;  // the walk is straight for this length on both sides of a door
inline constexpr double kRoomSpeed_mps = 1.8;
inline constexpr double kFollowing_s = 0.7;  // between the first and the second target

struct Room {
  int i = 0, j = 0;
  bool operator==(const Room&) const = default;
};

glm::dvec2 middle_of(const Room& room);

// The position of each door in its wall.
class RoomDoors {
 public:
  explicit RoomDoors(CounterRandom& random);
  // The door in the wall of `room` towards +x (across = 0) or +z (across = 1): its offset from the middle of the wall
  // along +z or +x, in [-1.2, 1.2).
  double offset_m(const Room& room, int across) const { return offsets_m_[room.i][room.j][across]; }
  // The middle of the door between two neighbours.
  glm::dvec2 between(const Room& a, const Room& b) const;

 private:
  double offsets_m_[kRooms][kRooms][2];
};

// A walk through `count` rooms, each a neighbour of the last, from room (0, 0) on. It never turns back through the door
// that it just passed, and prefers the rooms visited least.
std::vector<Room> choose_rooms(size_t count, CounterRandom& random);
// At least the number of rooms that a walk of `duration_s` reaches.
size_t rooms_within(double duration_s);

// The path through these rooms: straight through each door and straight from one threshold to the next. Corner 0 is the
// start of the second target; the thresholds of door k are corners 2 k + 1 and 2 k + 2.
Polyline path_through(const std::vector<Room>& rooms, const RoomDoors& doors);

// The path walked at kRoomSpeed_mps. `first_time_s` is the time at corner 0: -kFollowing_s for the first target, 0 for
// the second.
TimedPath at_even_speed(const Polyline& path, double first_time_s);

// The start of the camera: behind the second target, a little above head height.
glm::dvec3 room_eye_m(const Polyline& path);
void add_room_camera(ScenarioBuilder& scene, const Polyline& path);

// The floor and the outer walls; the inner walls with their doorways.
void add_room_shell(ScenarioBuilder& scene);
void add_inner_walls(ScenarioBuilder& scene, const RoomDoors& doors);

}  // namespace sightline::scenes
