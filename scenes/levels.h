// Levels: furnished rooms, halls and storeys on a grid of 4 m, with one to four targets that walk through them. They
// are built as levels of games are, from the parts of a set: walls 1 m thick and 4 m high, doorways 1.9 m wide,
// windows, pillars and furniture.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "scenes/level_parts.h"
#include "scenes/level_walk.h"

namespace sightline::scenes {

struct LevelOptions {
  uint64_t seed = 1;
  double duration_s = 40.0;          // [1, 600]
  LevelWalk walk = LevelWalk::kRow;  // walked at 1.5 to 2 m/s, the speed chosen by the seed
  bool roofed = false;               // a ceiling at 4 m
  int furniture_per_room = 5;        // [0, 20]: tries; a piece that would stand in the way is left out
};

// 4 x 3 rooms, 8 m from wall to wall; every room has two doors or more. A .glb file, as of the other two.
std::vector<std::byte> make_level_rooms(const LevelOptions& options, const PartMeshes& parts);
// 2 x 2 halls of 20 m. Pillars stand every 4 m, except in the targets' way. Openings are 2.5 m wide and as high as the
// walls.
std::vector<std::byte> make_level_halls(const LevelOptions& options, const PartMeshes& parts);
// The same rooms. Two targets leave the first room by different doors and walk through parallel rows of rooms with a
// wall between them. They meet again at the end of the rows and go on together. `walk` has no meaning.
std::vector<std::byte> make_level_parted(const LevelOptions& options, const PartMeshes& parts);
// Two storeys of 3 x 2 rooms of 12 m, and two flights of stairs. `walk` is kOne or kRow. `roofed` puts a ceiling on the
// upper storey.
std::vector<std::byte> make_level_storeys(const LevelOptions& options, const PartMeshes& parts);

}  // namespace sightline::scenes
