#include "scenes/levels.h"

#include <algorithm>
#include <cmath>

#include "scenes/exact.h"
#include "scenes/level_stage.h"

namespace sightline::scenes {
namespace {

constexpr int kColumns = 4, kRows = 3, kRoomTiles = 2;  // of the rooms
constexpr int kHalls = 2, kHallTiles = 5;
constexpr double kDoorShare = 0.5;  // of the walls that need no door

// The parts of one storey and a file of it.
struct Storey {
  const LevelPlan& plan;
  bool wide_doors = false;
  double pillar_share = 0;
};

std::vector<std::byte> build(const Storey& storey, const std::vector<Motion>& walks, const LevelCamera& camera,
                             const LevelOptions& options, const PartMeshes& parts, LevelRandom& random) {
  LevelLayout layout;
  layout.add_slabs(storey.plan, Part::kFloor, -kFloorTop_m);
  if (options.roofed) layout.add_slabs(storey.plan, Part::kPlanks, kLevelWall_m + kFloorUnder_m);
  layout.add_walls(storey.plan, 0, storey.wide_doors, random.walls);
  KeptFree free{points_in_use(walks, camera, 0), {}};
  const std::vector<glm::dvec2> doors = door_points(storey.plan);
  free.points_m.insert(free.points_m.end(), doors.begin(), doors.end());
  layout.add_pillars(storey.plan, 0, storey.pillar_share, free, random.furniture);
  layout.add_furniture(storey.plan, 0, options.furniture_per_room, free, random.furniture);
  ScenarioBuilder scene(options.duration_s);
  layout.build(scene, parts);
  add_actors(scene, walks, camera);
  return scene.write();
}

// At least the number of rooms that a walk of this length reaches. From door to door it is more than half of a room.
size_t rooms_within(double duration_s, const LevelPlan& plan) {
  return static_cast<size_t>(std::ceil(2.0 * duration_s / (plan.room_m() / 2))) + 2;
}

// A random walk through the rooms of a plan.
LevelPath wandering_path(const LevelPlan& plan, double duration_s, const RouteShape& shape, LevelRandom& random) {
  const LevelRoom first = plan.rooms()[random.walk.next_below(static_cast<uint32_t>(plan.rooms().size()))];
  const RoutePath path = path_of(plan, wander(plan, first, rooms_within(duration_s, plan), random.walk), shape,
                                 random.walk);
  return {path.corners, {}, path.first_corner_of_door};
}

std::vector<std::byte> make_wandering(const Storey& storey, const RouteShape& shape, double behind_m,
                                      const LevelOptions& options, const PartMeshes& parts, LevelRandom& random) {
  const double speed = choose_speed_mps(random.walk);
  const LevelPath path = wandering_path(storey.plan, options.duration_s, shape, random);
  return build(storey, walk_along(path, options.walk, speed, options.duration_s), camera_behind(path, behind_m),
               options, parts, random);
}

// The rows of rooms that two parted targets walk through, and the way that they have in common after it.
struct PartedRoutes {
  std::vector<LevelRoom> first, second;
};

PartedRoutes parted_routes() {
  PartedRoutes routes{{}, {{0, 0}}};
  for (int i = 0; i < kColumns; ++i) {
    routes.first.push_back({i, 0});
    routes.second.push_back({i, 1});
  }
  routes.first.push_back({kColumns - 1, 1});
  for (auto* route : {&routes.first, &routes.second})
    for (const LevelRoom& room :
         {LevelRoom{3, 2}, {2, 2}, {1, 2}, {0, 2}, {0, 1}, {0, 0}, {1, 0}, {1, 1}, {2, 1}, {2, 0}, {3, 0}})
      route->push_back(room);
  return routes;
}

void open_along(LevelPlan& plan, const std::vector<LevelRoom>& route) {
  for (size_t k = 0; k + 1 < route.size(); ++k) plan.open(route[k], route[k + 1]);
}

}  // namespace

std::vector<std::byte> make_level_rooms(const LevelOptions& options, const PartMeshes& parts) {
  LevelRandom random(options.seed);
  LevelPlan plan(kColumns, kRows, kRoomTiles, random.plan);
  plan.open_some(kDoorShare, random.plan);
  return make_wandering({plan}, {}, 2.3, options, parts, random);
}

std::vector<std::byte> make_level_halls(const LevelOptions& options, const PartMeshes& parts) {
  LevelRandom random(options.seed);
  LevelPlan plan(kHalls, kHalls, kHallTiles, random.plan);
  plan.open_some(1.0, random.plan);
  return make_wandering({plan, true, 0.8}, {.start_m = 12.0, .threshold_m = 2.2}, 4.0, options, parts, random);
}

std::vector<std::byte> make_level_parted(const LevelOptions& options, const PartMeshes& parts) {
  LevelRandom random(options.seed);
  LevelPlan plan(kColumns, kRows, kRoomTiles, random.plan);
  const PartedRoutes routes = parted_routes();
  plan.open_some(kDoorShare, random.plan);
  open_along(plan, routes.first);
  open_along(plan, routes.second);
  const double speed = choose_speed_mps(random.walk);
  // Both go straight from door to door, so that neither gains on the other. The second is 1.5 s further back.
  constexpr double kBehind_s = 1.5;
  const auto path = [&](const std::vector<LevelRoom>& route, double start_m) {
    const RoutePath through = path_of(plan, route, {.start_m = start_m, .bends = false}, random.walk);
    return LevelPath{through.corners, {}, through.first_corner_of_door};
  };
  const LevelPath first = path(routes.first, 3.0), second = path(routes.second, 3.4);
  const std::vector<Motion> walks{walk_one(first, even_times_s(first, speed, 0), options.duration_s),
                                  walk_one(second, even_times_s(second, speed, kBehind_s), options.duration_s)};
  // In the corner of the first room, with both before it.
  const glm::dvec3 between = (walks[0].positions_m[0] + walks[1].positions_m[0]) / 2.0;
  return build({plan}, walks, {{1.3, 2.0, 1.3}, {between.x, 1.1, between.z}}, options, parts, random);
}

}  // namespace sightline::scenes
