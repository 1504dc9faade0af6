// Doors: the nine rooms of `rooms`, with a sliding door in every doorway. A door opens before the two targets and
// closes behind them. It tests whether a camera keeps up: one that follows too far behind meets a closed door. It then
// has to find the targets again over the walls, or under a roof not at all.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace sightline::scenes {

struct DoorsOptions {
  uint64_t seed = 1;
  double duration_s = 30.0;  // [1, 600]
  // [0.5, 60]: time from the second target's passing until the door starts to close. It is half shut 0.5 s later and
  // shut 1 s later. At 0.7, a follower as fast as the targets gets through up to about 2 m behind the second.
  double hold_s = 0.7;
  double wait_s = 0.0;  // >= 0; the targets stand still for this time at first, so that the first door is seen shut
  bool roofed = false;  // closes the rooms above the walls (3 m): then the doors are the only way
};

// A .glb file. The leaves occlude and collide; they move at 1.25 m/s and never touch a target.
std::vector<std::byte> make_doors(const DoorsOptions& options);

}  // namespace sightline::scenes
