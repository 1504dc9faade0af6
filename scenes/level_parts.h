// The parts that levels consist of, on a grid of 4 m: floors, walls, stairs and furniture. There are two sets with the
// same parts: plain boxes, and the tiles of a folder (tile_set.h). A level has the same plan and the same walks with
// both sets.
//
// Frame of a part: metres, +Y up. The origin is on the floor, in the middle of the part; a wall runs along x.
// Exceptions:
//
//   corner   arms of 2 m towards -x and +z
//   tee      arms of 2 m towards -x, +x and +z
//   shelf    a wall with shelves on its side towards +z
//   stairs   up towards -z, from z = 6 to z = 0; the uppermost step is at kStorey_m
//   floor    its surface is kFloorTop_m above the origin, its underside kFloorUnder_m below
#pragma once

#include <array>
#include <glm/glm.hpp>
#include <string_view>

#include "server/scene/geometry.h"

namespace sightline::scenes {

inline constexpr double kTile_m = 4.0;
inline constexpr double kLevelWall_m = 4.0;      // height of a wall
inline constexpr double kLevelHalfWall_m = 0.5;  // half of its thickness
// a doorway is a little wider than this to both sides, and at least 2.1 m high
inline constexpr double kHalfDoorway_m = 0.95;
inline constexpr double kStorey_m = 4.05;  // from one floor to the floor above
inline constexpr double kFloorTop_m = 0.05;
inline constexpr double kFloorUnder_m = 0.1;
inline constexpr double kStairsRun_m = 6.0;

enum class Part {
  kFloor,
  kPlanks,
  kWall,
  kCrackedWall,
  kShelfWall,
  kDoorway,
  kWindow,
  kArchWindow,
  kCorner,
  kTee,
  kCross,
  kPillar,
  kRailing,
  kStairs,
  // furniture
  kBarrel,
  kSmallBarrel,
  kBarrels,
  kKeg,
  kBox,
  kBoxes,
  kCrates,
  kTable,
  kLongTable,
  kBed,
  kTrunk,
  kPost,
  kCount
};
inline constexpr size_t kPartCount = static_cast<size_t>(Part::kCount);
inline constexpr Part kFirstFurniture = Part::kBarrel;

struct PartKind {
  std::string_view name;
  std::string_view tile;  // name of its file in the tile set, without ".glb"
  // A box around it: the half sides along x and z, and the height. For furniture no vertex is outside of the box by
  // more than 1 cm.
  glm::dvec2 half_m;
  double height_m;
  glm::vec3 color;
};
const PartKind& kind_of(Part part);

using PartMeshes = std::array<MeshData, kPartCount>;  // by Part
PartMeshes block_parts();

}  // namespace sightline::scenes
