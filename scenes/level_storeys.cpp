// Levels of two storeys. Seen from above, the rooms of both storeys (mirrored in half of the seeds):
//
//   +-----+-----+-----+
//   |A    =  B  =    C|   A and F have a flight of stairs along their outer wall. Doors are at =. The walk leads from C
//   through B up the
//   +-----+-||--+-----+   stairs in A, on the upper storey through B and E down the stairs in F, and through E to D.
//   |D    =  E  =    F|
//   +-----+-----+-----+
#include <algorithm>

#include "scenes/level_stage.h"

namespace sightline::scenes {
namespace {

constexpr int kTiles = 3;  // of a room
constexpr double kSize_m = kTiles * kTile_m;
constexpr double kThreshold_m = 1.4;

// Where the flight of a room stands, in the room's own frame: x from the outer wall, z from the wall at the top of the
// stairs.
constexpr double kStairsX_m = 2.0;                   // the middle of the flight
constexpr double kTopZ_m = 4.0;                      // where the steps reach the upper floor
constexpr double kFootZ_m = kTopZ_m + kStairsRun_m;  // where they begin
// The walk rises on a line that is 0.1 to 0.17 m above the edges of the steps, so that the walker's lower end clears
// them.
constexpr double kRampFootZ_m = kFootZ_m + 0.8;
constexpr double kRampTopZ_m = kTopZ_m + 1.0;  // the edge of the uppermost step
constexpr double kRampFoot_m = 0.1;
constexpr double kRampTop_m = kStorey_m + 0.115;

struct Rooms {
  LevelRoom a, b, c, d, e, f;
  explicit Rooms(bool mirrored)
      : a{0, mirrored}, b{1, mirrored}, c{2, mirrored}, d{0, !mirrored}, e{1, !mirrored}, f{2, !mirrored} {}
};

// The frame of a room with a flight of stairs.
struct StairRoom {
  LevelRoom room;
  bool outer_at_high_x = false;
  bool top_at_high_z = false;

  glm::dvec2 at(double x, double z) const {
    return {(room.i * kSize_m) + (outer_at_high_x ? kSize_m - x : x),
            (room.j * kSize_m) + (top_at_high_z ? kSize_m - z : z)};
  }
  LevelRectangle rectangle(double low_z, double high_z) const {
    return {at(kStairsX_m, (low_z + high_z) / 2), {kTile_m / 2, (high_z - low_z) / 2}};
  }
  LevelRectangle steps() const { return rectangle(kTopZ_m, kFootZ_m); }
  LevelRectangle hole() const { return rectangle(kTopZ_m, kSize_m); }
};

// A path under construction.
class Climb {
 public:
  void add(const glm::dvec2& p, double height_m) {
    path_.corners.push_back(p);
    path_.heights_m.push_back(height_m);
  }
  void start_before(const LevelPlan& plan, const LevelRoom& from, const LevelRoom& to, double start_m) {
    add(plan.door_between(from, to) - forward(plan, from, to) * start_m, 0);
  }
  void pass(const LevelPlan& plan, const LevelRoom& from, const LevelRoom& to, double height_m) {
    path_.first_corner_of_door.push_back(path_.corners.size());
    for (const double side : {-kThreshold_m, kThreshold_m})
      add(plan.door_between(from, to) + forward(plan, from, to) * side, height_m);
  }
  void climb(const StairRoom& stairs, bool up) {
    std::vector<std::pair<glm::dvec2, double>> way{{stairs.at(6.5, kRampFootZ_m), 0},
                                                   {stairs.at(kStairsX_m + 1.5, kRampFootZ_m), 0},
                                                   {stairs.at(kStairsX_m, kRampFootZ_m), kRampFoot_m},
                                                   {stairs.at(kStairsX_m, kRampTopZ_m), kRampTop_m},
                                                   {stairs.at(kStairsX_m, kRampTopZ_m - 0.5), kRampTop_m},
                                                   {stairs.at(kStairsX_m, 3.0), kStorey_m},
                                                   {stairs.at(kStairsX_m, 2.25), kStorey_m},
                                                   {stairs.at(6, 2.25), kStorey_m}};
    if (!up) std::reverse(way.begin(), way.end());
    for (const auto& [p, height] : way) add(p, height);
  }
  const LevelPath& path() const { return path_; }

 private:
  static glm::dvec2 forward(const LevelPlan& plan, const LevelRoom& from, const LevelRoom& to) {
    return (plan.middle_of(to) - plan.middle_of(from)) / plan.room_m();
  }
  LevelPath path_;
};

LevelPlan storey_plan(const Rooms& rooms, CounterRandom& random) {
  LevelPlan plan(3, 2, kTiles, random);
  for (const auto& [from, to] :
       {std::pair(rooms.a, rooms.b), {rooms.b, rooms.c}, {rooms.b, rooms.e}, {rooms.d, rooms.e}, {rooms.e, rooms.f}})
    plan.open(from, to);
  return plan;
}

LevelPath path_over(const Rooms& rooms, const LevelPlan& lower, const LevelPlan& upper, const StairRoom& up,
                    const StairRoom& down) {
  Climb climb;
  climb.start_before(lower, rooms.c, rooms.b, 6.0);
  climb.pass(lower, rooms.c, rooms.b, 0);
  climb.pass(lower, rooms.b, rooms.a, 0);
  climb.climb(up, true);
  climb.pass(upper, rooms.a, rooms.b, kStorey_m);
  climb.pass(upper, rooms.b, rooms.e, kStorey_m);
  climb.pass(upper, rooms.e, rooms.f, kStorey_m);
  climb.climb(down, false);
  climb.pass(lower, rooms.f, rooms.e, 0);
  climb.pass(lower, rooms.e, rooms.d, 0);
  return climb.path();
}

void add_stairs(LevelLayout& layout, const StairRoom& stairs) {
  const glm::dvec2 origin = stairs.at(kStairsX_m, kTopZ_m);
  layout.add(Part::kStairs, {origin.x, 0, origin.y}, stairs.top_at_high_z ? 2 : 0);
  for (const double z : {6.0, 10.0}) {  // railings along the hole
    const glm::dvec2 p = stairs.at(kTile_m + 0.25, z);
    layout.add(Part::kRailing, {p.x, kStorey_m, p.y}, 1);
  }
}

// Furniture on one storey, around what the walk, the doors and the stairs need.
void furnish(LevelLayout& layout, const LevelPlan& plan, double base_m, std::vector<glm::dvec2> used,
             const std::vector<LevelRectangle>& taken, int tries, CounterRandom& random) {
  const std::vector<glm::dvec2> doors = door_points(plan);
  used.insert(used.end(), doors.begin(), doors.end());
  KeptFree free{std::move(used), taken};
  layout.add_furniture(plan, base_m, tries, free, random);
}

}  // namespace

std::vector<std::byte> make_level_storeys(const LevelOptions& options, const PartMeshes& parts) {
  LevelRandom random(options.seed);
  const Rooms rooms(random.plan.next_below(2) == 1);
  const StairRoom up{rooms.a, false, random.plan.next_below(2) == 1},
      down{rooms.f, true, random.plan.next_below(2) == 1};
  const LevelPlan lower = storey_plan(rooms, random.plan), upper = storey_plan(rooms, random.plan);
  const LevelPath path = path_over(rooms, lower, upper, up, down);
  const std::vector<Motion> walks = walk_along(path, options.walk, choose_speed_mps(random.walk), options.duration_s);
  const LevelCamera camera = camera_behind(path, 3.0);

  LevelLayout layout;
  layout.add_slabs(lower, Part::kFloor, -kFloorTop_m);
  layout.add_slabs(upper, Part::kPlanks, kStorey_m - kFloorTop_m, {up.hole(), down.hole()});
  if (options.roofed) layout.add_slabs(upper, Part::kPlanks, kStorey_m + kLevelWall_m + kFloorUnder_m);
  layout.add_walls(lower, 0, false, random.walls);
  layout.add_walls(upper, kStorey_m, false, random.walls);
  add_stairs(layout, up);
  add_stairs(layout, down);
  furnish(layout, lower, 0, points_in_use(walks, camera, 0), {up.steps(), down.steps()}, options.furniture_per_room,
          random.furniture);
  furnish(layout, upper, kStorey_m, points_in_use(walks, camera, kStorey_m), {up.hole(), down.hole()},
          options.furniture_per_room, random.furniture);
  ScenarioBuilder scene(options.duration_s);
  layout.build(scene, parts);
  add_actors(scene, walks, camera);
  return scene.write();
}

}  // namespace sightline::scenes
