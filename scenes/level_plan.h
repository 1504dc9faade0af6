// The plan of one storey of a level: square rooms in a grid, with doors in some of the walls between them, and routes
// through the rooms.
#pragma once

#include <glm/glm.hpp>
#include <vector>

#include "scenes/path.h"
#include "server/base/random.h"

namespace sightline::scenes {

struct LevelRoom {
  int i = 0, j = 0;  // column towards +x, row towards +z
  bool operator==(const LevelRoom&) const = default;
};

class LevelPlan {
 public:
  // Rooms of `tiles` x `tiles` tiles; room (i, j) covers [i, i + 1] x [j, j + 1] times room_m(), to the middle of its
  // walls. Chooses the position of the doorway in each wall, and shuts them all. With tiles == 1 there is no room for
  // doorways: open walls are left out altogether.
  LevelPlan(int rooms_x, int rooms_z, int tiles, CounterRandom& random);

  int rooms_x() const { return rooms_x_; }
  int rooms_z() const { return rooms_z_; }
  int tiles() const { return tiles_; }
  double room_m() const;
  glm::dvec2 middle_of(const LevelRoom& room) const;

  // `a` and `b` are neighbours.
  bool is_open(const LevelRoom& a, const LevelRoom& b) const { return wall(a, b).open; }
  void open(const LevelRoom& a, const LevelRoom& b) { wall(a, b).open = true; }
  // Opens walls until there is exactly one way from every room to every other; every such tree is equally probable.
  void open_tree(CounterRandom& random);
  // The same, then walls until every room has two doors or more, and then each further wall with probability `share`.
  void open_some(double share, CounterRandom& random);
  // The middle of the doorway between two neighbours, on a corner of tiles.
  glm::dvec2 door_between(const LevelRoom& a, const LevelRoom& b) const;
  std::vector<LevelRoom> neighbours(const LevelRoom& room) const;
  std::vector<LevelRoom> reachable(const LevelRoom& room) const;  // neighbours with an open door between
  std::vector<LevelRoom> rooms() const;

 private:
  struct Wall {
    int door = 1;  // in tiles from the corner towards -x or -z, [1, tiles - 1]
    bool open = false;
  };
  size_t index_of(const LevelRoom& a, const LevelRoom& b) const;
  const Wall& wall(const LevelRoom& a, const LevelRoom& b) const { return walls_[index_of(a, b)]; }
  Wall& wall(const LevelRoom& a, const LevelRoom& b) { return walls_[index_of(a, b)]; }

  int rooms_x_, rooms_z_, tiles_;
  std::vector<Wall> walls_;  // two a room: towards +x, towards +z
};

// A route of `count` rooms from `first` on, through open doors. It never turns back through the door that it just
// passed (every room needs two doors), and prefers the rooms visited least.
std::vector<LevelRoom> wander(const LevelPlan& plan, const LevelRoom& first, size_t count, CounterRandom& random);

struct RouteShape {
  double start_m = 4.2;      // from the start to the middle of the first door
  double threshold_m = 1.4;  // the path is straight for this length on both sides of a door's middle
  bool bends = true;         // between two doors there may be a corner at a random place of the room
};

// The path of a route. Corner 0 is in the first room, straight before its door; the last corner is behind the last
// door. Door k has the corners first_corner_of_door[k] and the next, its thresholds.
struct RoutePath {
  Polyline corners;
  std::vector<size_t> first_corner_of_door;
};
RoutePath path_of(const LevelPlan& plan, const std::vector<LevelRoom>& route, const RouteShape& shape,
                  CounterRandom& random);

// The cosine of the angle by which a path turns at `at`.
double turn_cosine(const glm::dvec2& from, const glm::dvec2& at, const glm::dvec2& to);

}  // namespace sightline::scenes
