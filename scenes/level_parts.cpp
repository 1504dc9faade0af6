#include "scenes/level_parts.h"

#include "scenes/scenario_builder.h"
#include "scenes/shapes.h"

namespace sightline::scenes {
namespace {

constexpr std::array<PartKind, kPartCount> kKinds{{
    {"floor", "floor_tile_large", {2, 2}, 0.05, colors::kFloor},
    {"planks", "floor_wood_large", {2, 2}, 0.05, colors::kWood},
    {"wall", "wall", {2, 0.5}, 4, colors::kWall},
    {"cracked-wall", "wall_cracked", {2, 0.63}, 4, colors::kWall},
    {"shelf-wall", "wall_shelves", {2, 0.87}, 4, colors::kWall},
    {"doorway", "wall_doorway", {2, 0.5}, 4, colors::kStone},
    {"window", "wall_window_open", {2, 0.5}, 4, colors::kWall},
    {"arch-window", "wall_archedwindow_open", {2, 0.5}, 4, colors::kWall},
    {"corner", "wall_corner", {2, 2}, 4, colors::kWall},
    {"tee", "wall_Tsplit", {2, 2}, 4, colors::kWall},
    {"cross", "wall_crossing", {2, 2}, 4, colors::kWall},
    {"pillar", "pillar", {0.75, 0.75}, 4, colors::kStone},
    {"railing", "barrier", {2, 0.25}, 1.1, colors::kStone},
    {"stairs", "stairs_wood", {1.65, 6}, 4.05, colors::kWood},
    {"barrel", "barrel_large", {0.9, 0.9}, 2, colors::kWood},
    {"small-barrel", "barrel_small", {0.5, 0.5}, 1.02, colors::kWood},
    {"barrels", "barrel_small_stack", {0.925, 0.5}, 1.77, colors::kWood},
    {"keg", "keg", {0.9, 1.02}, 2.05, colors::kWood},
    {"box", "box_large", {0.75, 0.75}, 1.5, colors::kWood},
    {"boxes", "box_stacked", {1.75, 1.86}, 3.31, colors::kWood},
    {"crates", "crates_stacked", {1.09, 1.16}, 2.14, colors::kWood},
    {"table", "table_medium", {1, 1}, 1, colors::kWood},
    {"long-table", "table_long", {1, 2}, 1, colors::kWood},
    {"bed", "bed_frame", {0.75, 1.5}, 1.06, colors::kWood},
    {"trunk", "trunk_large_A", {0.75, 0.65}, 1, colors::kWood},
    {"post", "column", {0.35, 0.35}, 1.4, colors::kStone},
}};

constexpr double kW = kLevelHalfWall_m, kH = kLevelWall_m;

MeshData floor_slab() {
  MeshData mesh;
  append_box(mesh, {-2, -kFloorUnder_m, -2}, {2, kFloorTop_m, 2});
  return mesh;
}

// A wall along x with an opening in its middle.
MeshData wall_with_opening(double half_m, double from_m, double to_m) {
  MeshData mesh;
  append_box(mesh, {-2, 0, -kW}, {-half_m, kH, kW});
  append_box(mesh, {half_m, 0, -kW}, {2, kH, kW});
  if (from_m > 0) append_box(mesh, {-half_m, 0, -kW}, {half_m, from_m, kW});
  append_box(mesh, {-half_m, to_m, -kW}, {half_m, kH, kW});
  return mesh;
}

MeshData shelf_wall() {
  MeshData mesh = standing_box(4, kH, 2 * kW);
  for (const double y : {0.75, 1.75}) append_box(mesh, {-1, y, kW}, {1, y + 0.125, 0.8125});
  return mesh;
}

// `arms`: bit 0 towards +x, 1 +z, 2 -x, 3 -z.
MeshData junction(unsigned arms) {
  MeshData mesh;
  append_box(mesh, {-kW, 0, -kW}, {kW, kH, kW});
  if (arms & 1u) append_box(mesh, {kW, 0, -kW}, {2, kH, kW});
  if (arms & 2u) append_box(mesh, {-kW, 0, kW}, {kW, kH, 2});
  if (arms & 4u) append_box(mesh, {-2, 0, -kW}, {-kW, kH, kW});
  if (arms & 8u) append_box(mesh, {-kW, 0, -2}, {kW, kH, -kW});
  return mesh;
}

// Seven steps of 0.5 m, then a landing 1 m long.
MeshData block_stairs() {
  MeshData mesh;
  const double depth = (kStairsRun_m - 1.0) / 7;
  for (int k = 0; k < 7; ++k)
    append_box(mesh, {-1.65, 0, kStairsRun_m - (k + 1) * depth}, {1.65, 0.5 * (k + 1), kStairsRun_m - k * depth});
  append_box(mesh, {-1.65, 0, 0}, {1.65, kStorey_m, 1});
  return mesh;
}

MeshData table(const glm::dvec2& half_m, double height_m) {
  MeshData mesh;
  append_box(mesh, {-half_m.x, height_m - 0.125, -half_m.y}, {half_m.x, height_m, half_m.y});
  for (const double x : {-1, 1})
    for (const double z : {-1, 1})
      append_box(mesh, {x * (half_m.x - 0.125) - 0.0625, 0, z * (half_m.y - 0.125) - 0.0625},
                 {x * (half_m.x - 0.125) + 0.0625, height_m - 0.125, z * (half_m.y - 0.125) + 0.0625});
  return mesh;
}

MeshData block_mesh(Part part) {
  const PartKind& kind = kind_of(part);
  switch (part) {
    case Part::kFloor:
    case Part::kPlanks:
      return floor_slab();
    case Part::kDoorway:
      return wall_with_opening(1.0, 0, 2.5);
    case Part::kWindow:
      return wall_with_opening(0.6875, 1.375, 2.625);
    case Part::kArchWindow:
      return wall_with_opening(1.0, 1.0, 2.5);
    case Part::kShelfWall:
      return shelf_wall();
    case Part::kCorner:
      return junction(4 | 2);
    case Part::kTee:
      return junction(4 | 1 | 2);
    case Part::kCross:
      return junction(15);
    case Part::kStairs:
      return block_stairs();
    case Part::kTable:
    case Part::kLongTable:
      return table(kind.half_m, kind.height_m);
    case Part::kWall:
    case Part::kCrackedWall:
      return standing_box(4, kH, 2 * kW);
    default:
      return standing_box(2 * kind.half_m.x, kind.height_m, 2 * kind.half_m.y);
  }
}

}  // namespace

const PartKind& kind_of(Part part) {
  return kKinds[static_cast<size_t>(part)];
}

PartMeshes block_parts() {
  PartMeshes meshes;
  for (size_t k = 0; k < kPartCount; ++k) meshes[k] = block_mesh(static_cast<Part>(k));
  return meshes;
}

}  // namespace sightline::scenes
