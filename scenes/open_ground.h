// Situations in which no wall hides a target. One target is faster than the camera; two part from each other; one
// leaves for good; one jumps. In the last scene the camera starts inside a wall.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "scenes/scenario_builder.h"

namespace sightline::scenes {

struct SprintOptions {
  uint64_t seed = 1;
  double duration_s = 40.0;  // [20, 600]
  CameraMotion limits{10.0, 10.0};
};
// A car speeds up to 1.3 times the camera's greatest speed, holds that until half of the time is over, and goes on at
// 0.8 times that speed.
std::vector<std::byte> make_sprint(const SprintOptions& options);

struct PartingOptions {
  uint64_t seed = 1;
  double duration_s = 60.0;  // [50, 600]
  bool for_good = false;     // the second target leaves at 8 m/s instead and does not come back
};
// Two targets walk side by side for 8 s. At 28 s they are 60 m apart; they stay there for 6 s and come back.
std::vector<std::byte> make_parting(const PartingOptions& options);

struct TeleportOptions {
  uint64_t seed = 1;
  double duration_s = 30.0;  // [1, 600]
  double jump_m = 20.0;      // [1, 60], every 8 s
};
// One target walks among columns, and is 20 m further on from one tick to the next every 8 s.
std::vector<std::byte> make_teleport(const TeleportOptions& options);

struct WalledInOptions {
  uint64_t seed = 1;
  double duration_s = 20.0;  // [1, 600]
};
// One target walks in a room of 12 m without a ceiling; the camera starts in the middle of one of its walls, which is
// 0.3 m thick.
std::vector<std::byte> make_walled_in(const WalledInOptions& options);

}  // namespace sightline::scenes
