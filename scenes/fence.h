// Fence (Figure 3 and Table 3 of the paper): two standing targets, and a sparse fence that moves back and
// forth between them and the camera. What it tests: temporal stability. Each picket hides a target for a
// moment only, so a camera that answers to each of them never rests.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace sightline::scenes {

struct FenceOptions {
  uint64_t seed = 1;
  double duration_s = 10.0;        // [1, 600]
  double period_s = 2.5;           // [0.5, 60]: once to and fro
  double amplitude_m = 0.9;        // [0, 2]: to each side; the fence always covers both targets
  double camera_distance_m = 6.0;  // [4, 20]: from the targets; the fence stands 2 m before them
  // From when on a solid board stands before both targets: an occlusion that lasts. [0, duration_s - 0.25]; 0: none ever.
  double board_at_s = 0.0;
};

// A .glb file.
std::vector<std::byte> make_fence(const FenceOptions& options);

}  // namespace sightline::scenes
