#include "scenes/room_plan.h"

#include <algorithm>
#include <cmath>

#include "scenes/exact.h"
#include "scenes/shapes.h"

namespace sightline::scenes {
namespace {

// One side of a room along x, its middle at the origin, with a door at `offset_m`.
MeshData wall_with_door(double offset_m) {
  MeshData mesh;
  const double end = kRoom_m / 2, left = offset_m - kHalfDoor_m, right = offset_m + kHalfDoor_m;
  append_box(mesh, {-end, 0, -kHalfWall_m}, {left, kWallHeight_m, kHalfWall_m});
  append_box(mesh, {right, 0, -kHalfWall_m}, {end, kWallHeight_m, kHalfWall_m});
  append_box(mesh, {left, kDoorHeight_m, -kHalfWall_m}, {right, kWallHeight_m, kHalfWall_m});
  return mesh;
}

}  // namespace

glm::dvec2 middle_of(const Room& room) {
  return {(room.i + 0.5) * kRoom_m, (room.j + 0.5) * kRoom_m};
}

RoomDoors::RoomDoors(CounterRandom& random) {
  for (auto& line : offsets_m_)
    for (auto& wall : line)
      for (double& offset : wall) offset = snapped_in(random, -1.2, 1.2);
}

glm::dvec2 RoomDoors::between(const Room& a, const Room& b) const {
  const Room low = a.i + a.j < b.i + b.j ? a : b;
  const int across = a.i != b.i ? 0 : 1;
  glm::dvec2 p = middle_of(low);
  p[across] += kRoom_m / 2;
  p[1 - across] += offset_m(low, across);
  return p;
}

std::vector<Room> choose_rooms(size_t count, CounterRandom& random) {
  int visits[kRooms][kRooms] = {};
  std::vector<Room> rooms{{0, 0}};
  while (rooms.size() < count) {
    const Room here = rooms.back();
    ++visits[here.i][here.j];
    std::vector<Room> best;
    for (const Room& next :
         {Room{here.i + 1, here.j}, Room{here.i - 1, here.j}, Room{here.i, here.j + 1}, Room{here.i, here.j - 1}}) {
      if (std::min(next.i, next.j) < 0 || std::max(next.i, next.j) >= kRooms) continue;
      if (rooms.size() > 1 && next == rooms[rooms.size() - 2]) continue;
      const int seen = visits[next.i][next.j];
      if (!best.empty() && seen > visits[best[0].i][best[0].j]) continue;
      if (!best.empty() && seen < visits[best[0].i][best[0].j]) best.clear();
      best.push_back(next);
    }
    rooms.push_back(best[random.next_below(static_cast<uint32_t>(best.size()))]);
  }
  return rooms;
}

size_t rooms_within(double duration_s) {
  return static_cast<size_t>(std::ceil(duration_s / 2)) + 2;  // a room takes at least 2 s: 3.6 m from door to door
}

Polyline path_through(const std::vector<Room>& rooms, const RoomDoors& doors) {
  Polyline path;
  for (size_t k = 0; k + 1 < rooms.size(); ++k) {
    const glm::dvec2 door = doors.between(rooms[k], rooms[k + 1]);
    const glm::dvec2 forward = (middle_of(rooms[k + 1]) - middle_of(rooms[k])) / kRoom_m;
    if (k == 0) path.push_back(door - forward * (kRoom_m - 2.6));  // where the second target starts
    path.push_back(door - forward * kThreshold_m);
    path.push_back(door + forward * kThreshold_m);
  }
  return path;
}

TimedPath at_even_speed(const Polyline& path, double first_time_s) {
  std::vector<double> times_s{first_time_s};
  for (size_t k = 1; k < path.size(); ++k)
    times_s.push_back(times_s.back() + length(path[k] - path[k - 1]) / kRoomSpeed_mps);
  return {path, times_s};
}

glm::dvec3 room_eye_m(const Polyline& path) {
  const glm::dvec2 start = path[0], forward = (path[1] - path[0]) / length(path[1] - path[0]);
  return {start.x - forward.x * 1.9, 1.9, start.y - forward.y * 1.9};
}

void add_room_camera(ScenarioBuilder& scene, const Polyline& path) {
  const glm::dvec2 start = path[0], forward = (path[1] - path[0]) / length(path[1] - path[0]);
  scene.add_camera(room_eye_m(path), {start.x + forward.x, 1.2, start.y + forward.y});
}

void add_room_shell(ScenarioBuilder& scene) {
  const double size = kRooms * kRoom_m, middle = size / 2;
  const int floor = scene.add_mesh("floor", standing_box(size + 4, 0.25, size + 4), colors::kFloor);
  scene.add_static("floor", floor, {middle, -0.25, middle});
  const int wall = scene.add_mesh("outer-wall", standing_box(size + 2 * kHalfWall_m, kWallHeight_m, 2 * kHalfWall_m),
                                  colors::kWall);
  scene.add_static("wall-north", wall, {middle, 0, 0});
  scene.add_static("wall-south", wall, {middle, 0, size});
  scene.add_static("wall-west", wall, {0, 0, middle}, quarter_turns(1));
  scene.add_static("wall-east", wall, {size, 0, middle}, quarter_turns(1));
}

void add_inner_walls(ScenarioBuilder& scene, const RoomDoors& doors) {
  for (int across : {0, 1})
    for (int i = 0; i < kRooms; ++i)
      for (int j = 0; j < kRooms; ++j) {
        if ((across == 0 ? i : j) == kRooms - 1) continue;  // an outer wall
        glm::dvec2 p = middle_of({i, j});
        p[across] += kRoom_m / 2;
        // A quarter turn about +Y takes the mesh's +x to -z.
        const double offset = doors.offset_m({i, j}, across);
        const std::string name = numbered(numbered(across == 0 ? "wall-x" : "wall-z", i), j);
        const int mesh = scene.add_mesh(name, wall_with_door(across == 0 ? -offset : offset), colors::kWall);
        scene.add_static(name, mesh, {p.x, 0, p.y}, quarter_turns(across == 0 ? 1 : 0));
      }
}

}  // namespace sightline::scenes
