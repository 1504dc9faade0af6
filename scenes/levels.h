// Levels: rooms, halls and storeys on a grid of 4 m, furnished, with one to four targets that walk through them. They stand for the levels
// of games, which are composed of the parts of a set: walls 1 m thick and 4 m high, doorways 1.9 m wide, windows, pillars and furniture.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "scenes/level_parts.h"
#include "scenes/level_walk.h"

namespace sightline::scenes {

struct LevelOptions {
  uint64_t seed = 1;
  double duration_s = 40.0;         // [1, 600]
  LevelWalk walk = LevelWalk::kRow;  // walked at 1.5 to 2 m/s, the speed chosen by the seed
  bool roofed = false;              // a ceiling at 4 m
  int furniture_per_room = 5;       // [0, 20]: tries; a piece that would stand in the way is left out
};

// 4 x 3 rooms, 8 m from wall to wall; every room has two doors or more. A .glb file, as of the other two.
std::vector<std::byte> make_level_rooms(const LevelOptions& options, const PartMeshes& parts);
// 2 x 2 halls of 20 m with pillars every 4 m where they do not stand in the way, and openings 2.5 m wide and as high as the walls.
std::vector<std::byte> make_level_halls(const LevelOptions& options, const PartMeshes& parts);
// The same rooms; two targets leave the first one by two doors, walk through parallel rows of rooms with a wall between them, meet again
// behind the last one and go on together. `walk` has no meaning.
std::vector<std::byte> make_level_parted(const LevelOptions& options, const PartMeshes& parts);
// Two storeys of 3 x 2 rooms of 12 m and two flights of stairs (level_storeys.cpp). `walk` is kOne or kRow. `roofed` is about the upper one.
std::vector<std::byte> make_level_storeys(const LevelOptions& options, const PartMeshes& parts);

}  // namespace sightline::scenes
