#include "scenes/level_plan.h"

#include <algorithm>
#include <cassert>

#include "scenes/exact.h"
#include "scenes/level_parts.h"

namespace sightline::scenes {
namespace {

constexpr double kSharpestCosine = -0.1;  // a turn of 96 degrees
constexpr double kFromWall_m = 2.2;       // a corner in a room keeps this far from the middle of its walls

LevelRoom any_of(const std::vector<LevelRoom>& rooms, CounterRandom& random) {
  return rooms[random.next_below(static_cast<uint32_t>(rooms.size()))];
}

// A corner in a room that the path can take between two doors without a sharp turn.
bool fits(const glm::dvec2& before, const glm::dvec2& in, const glm::dvec2& p, const glm::dvec2& out,
          const glm::dvec2& after) {
  return length(p - in) > 1.2 && length(out - p) > 1.2 && turn_cosine(before, in, p) > kSharpestCosine &&
         turn_cosine(in, p, out) > kSharpestCosine && turn_cosine(p, out, after) > kSharpestCosine;
}

}  // namespace

LevelPlan::LevelPlan(int rooms_x, int rooms_z, int tiles, CounterRandom& random)
    : rooms_x_(rooms_x), rooms_z_(rooms_z), tiles_(tiles), walls_(static_cast<size_t>(2 * rooms_x * rooms_z)) {
  for (Wall& wall : walls_)
    if (tiles > 1) wall.door = 1 + static_cast<int>(random.next_below(static_cast<uint32_t>(tiles - 1)));
}

double LevelPlan::room_m() const {
  return tiles_ * kTile_m;
}

glm::dvec2 LevelPlan::middle_of(const LevelRoom& room) const {
  return {(room.i + 0.5) * room_m(), (room.j + 0.5) * room_m()};
}

size_t LevelPlan::index_of(const LevelRoom& a, const LevelRoom& b) const {
  const LevelRoom low = a.i + a.j < b.i + b.j ? a : b;
  return static_cast<size_t>(2 * (low.i * rooms_z_ + low.j) + (a.i != b.i ? 0 : 1));
}

glm::dvec2 LevelPlan::door_between(const LevelRoom& a, const LevelRoom& b) const {
  const LevelRoom low = a.i + a.j < b.i + b.j ? a : b;
  const int across = a.i != b.i ? 0 : 1;
  glm::dvec2 p = glm::dvec2(low.i, low.j) * room_m();
  p[across] += room_m();
  p[1 - across] += wall(a, b).door * kTile_m;
  return p;
}

std::vector<LevelRoom> LevelPlan::neighbours(const LevelRoom& room) const {
  std::vector<LevelRoom> found;
  for (const LevelRoom& next : {LevelRoom{room.i + 1, room.j}, LevelRoom{room.i, room.j + 1},
                                LevelRoom{room.i - 1, room.j}, LevelRoom{room.i, room.j - 1}})
    if (next.i >= 0 && next.j >= 0 && next.i < rooms_x_ && next.j < rooms_z_) found.push_back(next);
  return found;
}

std::vector<LevelRoom> LevelPlan::reachable(const LevelRoom& room) const {
  std::vector<LevelRoom> found = neighbours(room);
  std::erase_if(found, [&](const LevelRoom& next) { return !is_open(room, next); });
  return found;
}

std::vector<LevelRoom> LevelPlan::rooms() const {
  std::vector<LevelRoom> all;
  for (int i = 0; i < rooms_x_; ++i)
    for (int j = 0; j < rooms_z_; ++j) all.push_back({i, j});
  return all;
}

// A random walk that opens the wall by which it enters a room for the first time (Aldous, "The random walk construction
// of uniform spanning trees", 1990).
void LevelPlan::open_tree(CounterRandom& random) {
  std::vector<LevelRoom> visited{{0, 0}};
  for (LevelRoom here{0, 0}; visited.size() < rooms().size();) {
    const LevelRoom next = any_of(neighbours(here), random);
    if (std::find(visited.begin(), visited.end(), next) == visited.end()) {
      open(here, next);
      visited.push_back(next);
    }
    here = next;
  }
}

void LevelPlan::open_some(double share, CounterRandom& random) {
  open_tree(random);
  for (const LevelRoom& room : rooms()) {
    while (reachable(room).size() < 2) open(room, any_of(neighbours(room), random));
    for (const LevelRoom& next : neighbours(room))
      if (next.i + next.j > room.i + room.j && random.next_unit() < share) open(room, next);
  }
}

std::vector<LevelRoom> wander(const LevelPlan& plan, const LevelRoom& first, size_t count, CounterRandom& random) {
  std::vector<LevelRoom> route{first};
  while (route.size() < count) {
    std::vector<LevelRoom> choices = plan.reachable(route.back());
    if (route.size() > 1) std::erase(choices, route[route.size() - 2]);
    assert(!choices.empty());
    const auto visits = [&](const LevelRoom& room) { return std::count(route.begin(), route.end(), room); };
    auto least = visits(choices[0]);
    for (const LevelRoom& room : choices) least = std::min(least, visits(room));
    std::erase_if(choices, [&](const LevelRoom& room) { return visits(room) > least; });
    route.push_back(any_of(choices, random));
  }
  return route;
}

double turn_cosine(const glm::dvec2& from, const glm::dvec2& at, const glm::dvec2& to) {
  const glm::dvec2 a = at - from, b = to - at;
  return (a.x * b.x + a.y * b.y) / (length(a) * length(b));
}

RoutePath path_of(const LevelPlan& plan, const std::vector<LevelRoom>& route, const RouteShape& shape,
                  CounterRandom& random) {
  RoutePath path;
  const double reach = plan.room_m() / 2 - kFromWall_m;
  for (size_t k = 0; k + 1 < route.size(); ++k) {
    const glm::dvec2 door = plan.door_between(route[k], route[k + 1]);
    const glm::dvec2 forward = (plan.middle_of(route[k + 1]) - plan.middle_of(route[k])) / plan.room_m();
    const glm::dvec2 before = door - forward * shape.threshold_m, behind = door + forward * shape.threshold_m;
    if (k == 0) path.corners.push_back(door - forward * shape.start_m);
    for (int attempt = 0; shape.bends && k > 0 && attempt < 3; ++attempt) {
      const double dx = snapped_in(random, -reach, reach), dz = snapped_in(random, -reach, reach);
      const glm::dvec2 p = plan.middle_of(route[k]) + glm::dvec2(dx, dz);
      const Polyline& c = path.corners;
      if (!fits(c[c.size() - 2], c.back(), p, before, behind)) continue;
      path.corners.push_back(p);
      break;
    }
    path.first_corner_of_door.push_back(path.corners.size());
    path.corners.push_back(before);
    path.corners.push_back(behind);
  }
  return path;
}

}  // namespace sightline::scenes
