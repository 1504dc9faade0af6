#include "scenes/level_layout.h"

#include <algorithm>
#include <cmath>

#include "scenes/exact.h"

namespace sightline::scenes {
namespace {

constexpr double kFreeWall_m = 0.9;  // furniture keeps this far from the middle of a wall, so that it clears shelves

glm::dvec3 lattice_point(const glm::ivec2& at, double base_m) {
  return {at.x * kTile_m, base_m, at.y * kTile_m};
}

// Which wall stands at a place without a door. Openings are for walls between rooms.
Part choose_wall(bool outer, CounterRandom& random) {
  const double draw = random.next_unit();
  if (draw < 0.08) return Part::kCrackedWall;
  if (draw < 0.22) return Part::kShelfWall;
  if (!outer && draw < 0.30) return Part::kWindow;
  if (!outer && draw < 0.36) return Part::kArchWindow;
  return Part::kWall;
}

// The rooms on the two sides of a place in a wall; empty beyond the outer walls.
std::array<std::optional<LevelRoom>, 2> sides_of(const LevelPlan& plan, const glm::ivec2& at, bool along_x) {
  const auto room_at = [&](const glm::ivec2& tile) -> std::optional<LevelRoom> {
    if (tile.x < 0 || tile.y < 0 || tile.x >= plan.rooms_x() * plan.tiles() || tile.y >= plan.rooms_z() * plan.tiles())
      return {};
    return LevelRoom{tile.x / plan.tiles(), tile.y / plan.tiles()};
  };
  return {room_at(along_x ? at + glm::ivec2(0, -1) : at + glm::ivec2(-1, 0)), room_at(at)};
}

// A place in a room for a piece: at a wall three times out of five.
glm::dvec2 choose_place(const glm::dvec2& reach_m, CounterRandom& random) {
  glm::dvec2 p{snapped_in(random, -reach_m.x, reach_m.x), snapped_in(random, -reach_m.y, reach_m.y)};
  const uint32_t draw = random.next_below(10);
  if (draw < 6) {
    const int axis = draw % 2 == 0 ? 0 : 1;
    p[axis] = draw < 3 ? reach_m[axis] : -reach_m[axis];
  }
  return p;
}

}  // namespace

double LevelRectangle::distance_m(const glm::dvec2& p) const {
  const double dx = std::abs(p.x - middle_m.x) - half_m.x, dz = std::abs(p.y - middle_m.y) - half_m.y;
  return length({std::max(dx, 0.0), std::max(dz, 0.0)});
}

bool LevelRectangle::meets(const LevelRectangle& other) const {
  constexpr double kApart_m = 0.1;
  return std::abs(middle_m.x - other.middle_m.x) < half_m.x + other.half_m.x + kApart_m &&
         std::abs(middle_m.y - other.middle_m.y) < half_m.y + other.half_m.y + kApart_m;
}

bool KeptFree::allows(const LevelRectangle& piece) const {
  return std::none_of(points_m.begin(), points_m.end(),
                      [&](const glm::dvec2& p) { return piece.distance_m(p) < kFreeWay_m; }) &&
         std::none_of(taken.begin(), taken.end(), [&](const LevelRectangle& other) { return piece.meets(other); });
}

void LevelLayout::add_straight(const LevelPlan& plan, const glm::ivec2& at, double base_m, bool wide_doors,
                               CounterRandom& random) {
  const bool along_x = at.y % plan.tiles() == 0;
  const auto [low, high] = sides_of(plan, at, along_x);
  const bool outer = !low || !high;
  const glm::dvec3 p = lattice_point(at, base_m);
  const int turns = along_x ? 0 : 1;
  if (!outer && plan.is_open(*low, *high) && plan.door_between(*low, *high) == glm::dvec2(p.x, p.z)) {
    if (!wide_doors) return add(Part::kDoorway, p, turns);
    const glm::dvec3 along = along_x ? glm::dvec3(kTile_m / 2, 0, 0) : glm::dvec3(0, 0, kTile_m / 2);
    add(Part::kPillar, p - along, 0);
    return add(Part::kPillar, p + along, 0);
  }
  const Part part = choose_wall(outer, random);
  // Shelves face a room. Without a turn they face the room on the side of higher z, with one that of higher x.
  const bool away = part == Part::kShelfWall && (outer ? !high : random.next_below(2) == 0);
  add(part, p, away ? turns + 2 : turns);
}

void LevelLayout::add_junction(const LevelPlan& plan, const glm::ivec2& at, double base_m) {
  const bool at_low_x = at.x == 0, at_high_x = at.x == plan.rooms_x() * plan.tiles();
  const bool at_low_z = at.y == 0, at_high_z = at.y == plan.rooms_z() * plan.tiles();
  const glm::dvec3 p = lattice_point(at, base_m);
  if ((at_low_x || at_high_x) && (at_low_z || at_high_z))
    return add(Part::kCorner, p, at_low_z ? (at_low_x ? 1 : 0) : (at_low_x ? 2 : 3));
  if (at_low_z) return add(Part::kTee, p, 0);
  if (at_low_x) return add(Part::kTee, p, 1);
  if (at_high_z) return add(Part::kTee, p, 2);
  if (at_high_x) return add(Part::kTee, p, 3);
  add(Part::kCross, p, 0);
}

void LevelLayout::add_walls(const LevelPlan& plan, double base_m, bool wide_doors, CounterRandom& random) {
  const int tiles = plan.tiles();
  for (int u = 0; u <= plan.rooms_x() * tiles; ++u)
    for (int v = 0; v <= plan.rooms_z() * tiles; ++v) {
      if (u % tiles == 0 && v % tiles == 0)
        add_junction(plan, {u, v}, base_m);
      else if (u % tiles == 0 || v % tiles == 0)
        add_straight(plan, {u, v}, base_m, wide_doors, random);
    }
}

void LevelLayout::add_slabs(const LevelPlan& plan, Part part, double origin_y_m,
                            const std::vector<LevelRectangle>& holes) {
  for (int u = 0; u < plan.rooms_x() * plan.tiles(); ++u)
    for (int v = 0; v < plan.rooms_z() * plan.tiles(); ++v) {
      const glm::dvec2 middle{(u + 0.5) * kTile_m, (v + 0.5) * kTile_m};
      const bool in_hole = std::any_of(holes.begin(), holes.end(),
                                       [&](const LevelRectangle& hole) { return hole.distance_m(middle) == 0; });
      if (!in_hole) add(part, {middle.x, origin_y_m, middle.y}, 0);
    }
}

void LevelLayout::add_pillars(const LevelPlan& plan, double base_m, double share, KeptFree& free,
                              CounterRandom& random) {
  for (int u = 0; u < plan.rooms_x() * plan.tiles(); ++u)
    for (int v = 0; v < plan.rooms_z() * plan.tiles(); ++v) {
      if (u % plan.tiles() == 0 || v % plan.tiles() == 0) continue;
      const LevelRectangle piece{{u * kTile_m, v * kTile_m}, kind_of(Part::kPillar).half_m};
      if (random.next_unit() >= share || !free.allows(piece)) continue;
      free.taken.push_back(piece);
      add(Part::kPillar, lattice_point({u, v}, base_m), 0);
    }
}

void LevelLayout::add_furniture(const LevelPlan& plan, double base_m, int tries_per_room, KeptFree& free,
                                CounterRandom& random) {
  constexpr auto kFirst = static_cast<uint32_t>(kFirstFurniture);
  for (const LevelRoom& room : plan.rooms())
    for (int attempt = 0; attempt < tries_per_room; ++attempt) {
      const auto part = static_cast<Part>(kFirst + random.next_below(static_cast<uint32_t>(kPartCount) - kFirst));
      const int turns = static_cast<int>(random.next_below(4));
      glm::dvec2 half = kind_of(part).half_m;
      if (turns % 2 == 1) std::swap(half.x, half.y);
      const glm::dvec2 place = choose_place(glm::dvec2(plan.room_m() / 2 - kFreeWall_m) - half, random);
      const LevelRectangle piece{plan.middle_of(room) + place, half};
      if (!free.allows(piece)) continue;
      free.taken.push_back(piece);
      add(part, {piece.middle_m.x, base_m, piece.middle_m.y}, turns);
    }
}

void LevelLayout::build(ScenarioBuilder& scene, const PartMeshes& meshes) const {
  std::array<int, kPartCount> mesh_of{}, count{};
  mesh_of.fill(-1);
  for (const Piece& piece : pieces_) {
    const auto k = static_cast<size_t>(piece.part);
    const PartKind& kind = kind_of(piece.part);
    if (mesh_of[k] < 0) mesh_of[k] = scene.add_mesh(std::string(kind.name), meshes[k], kind.color);
    scene.add_static(numbered(std::string(kind.name), ++count[k]), mesh_of[k], piece.position_m,
                     quarter_turns(piece.turns));
  }
}

std::vector<glm::dvec2> door_points(const LevelPlan& plan) {
  std::vector<glm::dvec2> points;
  for (const LevelRoom& room : plan.rooms())
    for (const LevelRoom& next : plan.reachable(room)) {
      const glm::dvec2 forward = (plan.middle_of(next) - plan.middle_of(room)) / plan.room_m();
      points.push_back(plan.door_between(room, next));
      points.push_back(points.back() + forward);
    }
  return points;
}

}  // namespace sightline::scenes
