#include "scenes/rooms.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "scenes/exact.h"
#include "scenes/scenario_builder.h"
#include "scenes/shapes.h"

namespace sightline::scenes {
namespace {

// Room (i, j) covers [6 i, 6 i + 6] x [6 j, 6 j + 6] in x and z, measured to the middle of its walls.
constexpr int kRooms = 3;
constexpr double kRoom_m = 6.0;
constexpr double kHalfWall_m = 0.1;
constexpr double kWallHeight_m = 3.0;
constexpr double kHalfDoor_m = 0.6;
constexpr double kDoorHeight_m = 2.2;
constexpr double kThreshold_m = 1.0;  // walked straight on both sides of a door
constexpr double kSpeed_mps = 1.8;
constexpr double kFollowing_s = 0.7;  // between the first and the second target
constexpr double kFreeWay_m = 0.7;    // between furniture and the targets' axes

struct Room {
  int i = 0, j = 0;
  bool operator==(const Room&) const = default;
};

glm::dvec2 middle_of(const Room& room) {
  return {(room.i + 0.5) * kRoom_m, (room.j + 0.5) * kRoom_m};
}

// How far each door stands from the middle of its wall.
class Doors {
 public:
  explicit Doors(CounterRandom& random) {
    for (auto& line : offsets_m_)
      for (auto& wall : line)
        for (double& offset : wall) offset = snapped_in(random, -1.2, 1.2);
  }
  // The door in the wall towards +x (across = 0) or +z (1) of `room`.
  double offset_m(const Room& room, int across) const { return offsets_m_[room.i][room.j][across]; }
  // The middle of the door between two neighbours.
  glm::dvec2 between(const Room& a, const Room& b) const {
    const Room low = a.i + a.j < b.i + b.j ? a : b;
    const int across = a.i != b.i ? 0 : 1;
    glm::dvec2 p = middle_of(low);
    p[across] += kRoom_m / 2;
    p[1 - across] += offset_m(low, across);
    return p;
  }

 private:
  double offsets_m_[kRooms][kRooms][2];
};

// A walk over neighbouring rooms that never turns back through the door it came by, and prefers rooms seen
// least.
std::vector<Room> choose_rooms(size_t count, CounterRandom& random) {
  int visits[kRooms][kRooms] = {};
  std::vector<Room> rooms{{0, 0}};
  while (rooms.size() < count) {
    const Room here = rooms.back();
    ++visits[here.i][here.j];
    std::vector<Room> best;
    for (const Room& next : {Room{here.i + 1, here.j}, Room{here.i - 1, here.j}, Room{here.i, here.j + 1},
                             Room{here.i, here.j - 1}}) {
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

// Straight through each door, straight from threshold to threshold.
Polyline way_through(const std::vector<Room>& rooms, const Doors& doors) {
  Polyline way;
  for (size_t k = 0; k + 1 < rooms.size(); ++k) {
    const glm::dvec2 door = doors.between(rooms[k], rooms[k + 1]);
    const glm::dvec2 forward = (middle_of(rooms[k + 1]) - middle_of(rooms[k])) / kRoom_m;
    if (k == 0) way.push_back(door - forward * (kRoom_m - 2.6));  // where the second target starts
    way.push_back(door - forward * kThreshold_m);
    way.push_back(door + forward * kThreshold_m);
  }
  return way;
}

TimedPath at_even_speed(const Polyline& way, double first_time_s) {
  std::vector<double> times_s{first_time_s};
  for (size_t k = 1; k < way.size(); ++k)
    times_s.push_back(times_s.back() + length(way[k] - way[k - 1]) / kSpeed_mps);
  return {way, times_s};
}

// One side of a room along x, its middle at the origin, with a door at `offset_m`.
MeshData wall_with_door(double offset_m) {
  MeshData mesh;
  const double end = kRoom_m / 2, left = offset_m - kHalfDoor_m, right = offset_m + kHalfDoor_m;
  append_box(mesh, {-end, 0, -kHalfWall_m}, {left, kWallHeight_m, kHalfWall_m});
  append_box(mesh, {right, 0, -kHalfWall_m}, {end, kWallHeight_m, kHalfWall_m});
  append_box(mesh, {left, kDoorHeight_m, -kHalfWall_m}, {right, kWallHeight_m, kHalfWall_m});
  return mesh;
}

void add_inner_walls(ScenarioBuilder& scene, const Doors& doors) {
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

void add_shell(ScenarioBuilder& scene) {
  const double size = kRooms * kRoom_m, middle = size / 2;
  const int floor = scene.add_mesh("floor", standing_box(size + 4, 0.25, size + 4), colors::kFloor);
  scene.add_static("floor", floor, {middle, -0.25, middle});
  const int wall = scene.add_mesh(
      "outer-wall", standing_box(size + 2 * kHalfWall_m, kWallHeight_m, 2 * kHalfWall_m), colors::kWall);
  scene.add_static("wall-north", wall, {middle, 0, 0});
  scene.add_static("wall-south", wall, {middle, 0, size});
  scene.add_static("wall-west", wall, {0, 0, middle}, quarter_turns(1));
  scene.add_static("wall-east", wall, {size, 0, middle}, quarter_turns(1));
}

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

// Where no furniture may stand: the targets' ways, the doors, the camera's place.
std::vector<glm::dvec2> places_kept_free(const std::array<Motion, 2>& walks, const Doors& doors,
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
  const Doors doors(plan_random);
  // A room takes at least 2 s: 3.6 m from door to door.
  const auto count = static_cast<size_t>(std::ceil(options.duration_s / 2)) + 2;
  const std::vector<Room> rooms = choose_rooms(count, plan_random);
  const Polyline way = way_through(rooms, doors);
  const std::array<Motion, 2> walks{walk(at_even_speed(way, -kFollowing_s), options.duration_s),
                                    walk(at_even_speed(way, 0), options.duration_s)};

  ScenarioBuilder scene(options.duration_s);
  add_shell(scene);
  add_inner_walls(scene, doors);
  const glm::dvec2 start = way[0], forward = (way[1] - way[0]) / length(way[1] - way[0]);
  const glm::dvec3 eye{start.x - forward.x * 1.9, 1.9, start.y - forward.y * 1.9};
  add_furniture(scene, options.furniture_per_room, places_kept_free(walks, doors, eye), furniture_random);
  scene.add_camera(eye, {start.x + forward.x, 1.2, start.y + forward.y});
  scene.add_character("target-1", walks[0]);
  scene.add_character("target-2", walks[1]);
  return scene.write();
}

}  // namespace sightline::scenes
