// Maze: 11 x 11 cells of 2.5 m with exactly one way between any two, walls 2.5 m high. The targets walk the longest way
// through it. It tests a camera whose way to the targets is much longer than the distance to them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace sightline::scenes {

struct MazeOptions {
  uint64_t seed = 1;
  double duration_s = 40.0;  // [1, 60]
  int targets = 2;           // 1, or 2 one behind the other
  bool roofed = false;
};

// A .glb file.
std::vector<std::byte> make_maze(const MazeOptions& options);

}  // namespace sightline::scenes
