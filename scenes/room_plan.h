// Nine rooms, three by three, with a door in every wall between two of them, and a walk from room to room:
// what the scenes `rooms` and `doors` share.
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
inline constexpr double kThreshold_m = 1.0;  // walked straight on both sides of a door
inline constexpr double kRoomSpeed_mps = 1.8;
inline constexpr double kFollowing_s = 0.7;  // between the first and the second target

struct Room {
  int i = 0, j = 0;
  bool operator==(const Room&) const = default;
};

glm::dvec2 middle_of(const Room& room);

// How far each door stands from the middle of its wall.
class RoomDoors {
 public:
  explicit RoomDoors(CounterRandom& random);
  // The door in the wall towards +x (across = 0) or +z (1) of `room`; in [-1.2, 1.2), along +z or +x.
  double offset_m(const Room& room, int across) const { return offsets_m_[room.i][room.j][across]; }
  // The middle of the door between two neighbours.
  glm::dvec2 between(const Room& a, const Room& b) const;

 private:
  double offsets_m_[kRooms][kRooms][2];
};

// A walk of `count` neighbouring rooms from room (0, 0) that never turns back through the door it came by,
// and prefers rooms seen least.
std::vector<Room> choose_rooms(size_t count, CounterRandom& random);
// As many rooms as a walk of `duration_s` can reach, and a few more.
size_t rooms_within(double duration_s);

// Straight through each door, straight from threshold to threshold. Corner 0 is where the second target
// starts; the thresholds of door k are corners 2 k + 1 and 2 k + 2.
Polyline way_through(const std::vector<Room>& rooms, const RoomDoors& doors);

// At kRoomSpeed_mps, from corner 0 at `first_time_s`: -kFollowing_s for the first target, 0 for the second.
TimedPath at_even_speed(const Polyline& way, double first_time_s);

// Behind the second target's start, at the height of a raised head.
glm::dvec3 room_eye_m(const Polyline& way);
void add_room_camera(ScenarioBuilder& scene, const Polyline& way);

// Floor and outer walls; then the walls with their doorways.
void add_room_shell(ScenarioBuilder& scene);
void add_inner_walls(ScenarioBuilder& scene, const RoomDoors& doors);

}  // namespace sightline::scenes
