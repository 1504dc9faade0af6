// Hall (the scene of the paper's Table 2): a colonnade of three lanes in which two targets walk side by side,
// turning sharply between the columns, while curtains fall and panels rise behind them, between them and
// their camera.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace sightline::scenes {

struct HallOptions {
  uint64_t seed = 1;
  double duration_s = 30.0;  // [1, 600]; the hall is as long as the walk needs
  double ceiling_m = 4.5;    // [4, 20]: lower keeps the camera among the columns
  double wall_share = 0.5;   // [0, 1]: of the openings that the targets do not use, how many are walled up
  double curtain_period_s = 2.2;  // [1, 600]: mean time between sudden occluders
};

// A .glb file. Nothing in it ever blocks the way that the targets take.
std::vector<std::byte> make_hall(const HallOptions& options);

}  // namespace sightline::scenes
