#include "scenes/doors.h"

#include <algorithm>
#include <cmath>

#include "scenes/exact.h"
#include "scenes/room_plan.h"
#include "scenes/shapes.h"

namespace sightline::scenes {
namespace {

constexpr double kLeaf_m = 1.25;  // wide, and as far as it slides; inside the wall when open
constexpr double kSliding_s = 1.0;
constexpr double kOpensBefore_s = 1.8;  // the first target passes

// A time during which a door is not shut: from the first move of its leaf to the last.
struct Opening {
  double opens_s;
  double shut_s;
};

struct Door {
  Room low;                       // the room at its side towards -x or -z
  int across = 0;                 // 0: in the wall towards +x, 1: towards +z
  std::vector<Opening> openings;  // in order of time, apart from each other
};

std::vector<Door> all_doors() {
  std::vector<Door> doors;
  for (int i = 0; i < kRooms; ++i)
    for (int j = 0; j < kRooms; ++j) {
      if (i + 1 < kRooms) doors.push_back({{i, j}, 0, {}});
      if (j + 1 < kRooms) doors.push_back({{i, j}, 1, {}});
    }
  return doors;
}

Door& door_between(std::vector<Door>& doors, const Room& a, const Room& b) {
  const Room low = a.i + a.j < b.i + b.j ? a : b;
  const int across = a.i != b.i ? 0 : 1;
  return *std::find_if(doors.begin(), doors.end(),
                       [&](const Door& door) { return door.low == low && door.across == across; });
}

// A door that would shut and open again at once stays open instead.
void add_opening(Door& door, const Opening& opening) {
  if (!door.openings.empty() && opening.opens_s < door.openings.back().shut_s + kSliding_s)
    door.openings.back().shut_s = opening.shut_s;
  else
    door.openings.push_back(opening);
}

// The time at which the second target passes each door of its path.
std::vector<double> passing_times_s(const Polyline& path) {
  std::vector<double> times_s;
  double walked_m = 0;
  for (size_t k = 1; k + 1 < path.size(); k += 2) {
    walked_m += length(path[k] - path[k - 1]);
    const double through_m = length(path[k + 1] - path[k]);
    times_s.push_back((walked_m + through_m / 2) / kRoomSpeed_mps);
    walked_m += through_m;
  }
  return times_s;
}

std::vector<Door> doors_along(const std::vector<Room>& rooms, const Polyline& path, const DoorsOptions& options) {
  std::vector<Door> doors = all_doors();
  const std::vector<double> passing_s = passing_times_s(path);
  for (size_t k = 0; k < passing_s.size(); ++k)
    add_opening(door_between(doors, rooms[k], rooms[k + 1]),
                {options.wait_s + passing_s[k] - kFollowing_s - kOpensBefore_s,
                 options.wait_s + passing_s[k] + options.hold_s + kSliding_s});
  return doors;
}

// The part of a door that is open at a time, 0 to 1.
double openness(const Door& door, double time_s) {
  for (const Opening& opening : door.openings)
    if (opening.opens_s < time_s && time_s < opening.shut_s)
      return std::min({1.0, (time_s - opening.opens_s) / kSliding_s, (opening.shut_s - time_s) / kSliding_s});
  return 0;
}

// The ends of the straight pieces of its leaf's motion, and the ends of the scenario.
std::vector<double> key_times_s(const Door& door, double duration_s) {
  std::vector<double> times_s{0};
  for (const Opening& o : door.openings)
    for (double time_s : {o.opens_s, o.opens_s + kSliding_s, o.shut_s - kSliding_s, o.shut_s})
      if (time_s > times_s.back() && time_s < duration_s) times_s.push_back(time_s);
  times_s.push_back(duration_s);
  return times_s;
}

// Slides away from the nearer corner of the room, where the wall has room for it.
Motion sliding(const Door& door, double offset_m, double duration_s) {
  glm::dvec2 shut = middle_of(door.low), slide(0.0);
  shut[door.across] += kRoom_m / 2;
  shut[1 - door.across] += offset_m;
  slide[1 - door.across] = offset_m > 0 ? -kLeaf_m : kLeaf_m;
  Motion motion;
  for (double time_s : key_times_s(door, duration_s)) {
    const glm::dvec2 p = shut + slide * openness(door, time_s);
    motion.add(time_s, {p.x, 0, p.y}, quarter_turns(door.across == 0 ? 1 : 0));
  }
  return motion;
}

// The same motion, begun later; the scenario ends as before.
Motion after(double wait_s, const Motion& motion) {
  if (wait_s <= 0) return motion;
  Motion later;
  later.add(0, motion.positions_m.front(), motion.rotations.front());
  for (size_t i = 0; i < motion.times_s.size() && motion.times_s[i] + wait_s <= motion.times_s.back(); ++i)
    later.add(motion.times_s[i] + wait_s, motion.positions_m[i], motion.rotations[i]);
  return later;
}

void add_leaves(ScenarioBuilder& scene, const std::vector<Door>& doors, const RoomDoors& plan) {
  const int leaf = scene.add_mesh("leaf", standing_box(kLeaf_m, kDoorHeight_m + 0.0625, kHalfWall_m), colors::kWood);
  for (const Door& door : doors)
    scene.add_occluder(numbered(numbered(door.across == 0 ? "door-x" : "door-z", door.low.i), door.low.j), leaf,
                       sliding(door, plan.offset_m(door.low, door.across), scene.duration_s()), {});
}

void add_roof(ScenarioBuilder& scene) {
  const double size = kRooms * kRoom_m + 2 * kHalfWall_m;
  scene.add_static("roof", scene.add_mesh("roof", standing_box(size, 0.25, size), colors::kFloor),
                   {kRooms * kRoom_m / 2, kWallHeight_m, kRooms * kRoom_m / 2});
}

}  // namespace

std::vector<std::byte> make_doors(const DoorsOptions& options) {
  CounterRandom random(options.seed, 0, RandomPurpose::kSceneGeneration);
  const RoomDoors plan(random);
  const std::vector<Room> rooms = choose_rooms(rooms_within(options.duration_s), random);
  const Polyline path = path_through(rooms, plan);

  ScenarioBuilder scene(options.duration_s);
  add_room_shell(scene);
  add_inner_walls(scene, plan);
  if (options.roofed) add_roof(scene);
  add_room_camera(scene, path);
  scene.add_character("target-1", after(options.wait_s, walk(at_even_speed(path, -kFollowing_s), options.duration_s)));
  scene.add_character("target-2", after(options.wait_s, walk(at_even_speed(path, 0), options.duration_s)));
  add_leaves(scene, doors_along(rooms, path, options), plan);
  return scene.write();
}

}  // namespace sightline::scenes
