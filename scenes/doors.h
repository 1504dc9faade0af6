// Doors: the nine rooms of `rooms`, with a sliding door in every doorway. A door opens before the two targets
// and closes behind them. What it tests: keeping up. Who follows too far behind stands before a closed door,
// and has to find the targets again over the walls or, under a roof, not at all.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace sightline::scenes {

struct DoorsOptions {
  uint64_t seed = 1;
  double duration_s = 30.0;  // [1, 600]
  // [0.5, 60]: from the second target's passing to the first move of the door. 0.5 s later it is half shut, 1
  // s later shut; at 0.7 a follower as fast as the targets gets through up to about 2 m behind the second.
  double hold_s = 0.7;
  bool roofed = false;  // closes the rooms above the walls (3 m): the doors are then the only way
};

// A .glb file. The leaves occlude and collide; they move at 1.25 m/s and never touch a target.
std::vector<std::byte> make_doors(const DoorsOptions& options);

}  // namespace sightline::scenes
