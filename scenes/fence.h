// Fence (Figure 3 and Table 3 of the paper): two standing targets, and a sparse fence that moves back and forth between
// them and the camera. It tests temporal stability: each picket hides a part of a target for a moment only, so a camera
// that reacts to every picket never rests.
//
// A filter of 6 in 10 calms the camera when it sees both targets in at least 6 of any 10 steps. The fence is made for
// that.
//   Sparse  A picket of 4 cm follows 75 to 90 cm of air. One sampled point of a target in twenty is hidden, and both
//   targets are
//           visible in nine steps of ten. With 33 % of wood, two points in five would always be hidden. The share would
//           vary within any window, and every filter would move the camera more than none.
//   Fast    At 3 m/s, a picket passes the width of a target within 9 steps of 1/60 s, so hidden steps are spread out.
//   Sharp   The fence bounces off its stops at full speed. A pendulum would linger at its turns and keep a picket
//   before one target
//           for a third of a second.
//   Late    The fence stands still for the first quarter of a second, with air before both targets. A filter counts
//   over the steps
//           that it has, and at the start one hidden step would be all of them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "scenes/scenario_builder.h"

namespace sightline::scenes {

struct FenceOptions {
  uint64_t seed = 1;
  double duration_s = 10.0;                         // [1, 600]
  double period_s = 1.2;                            // [0.5, 60]: time to move to and fro once
  double amplitude_m = 0.9;                         // [0, 2]: to each side; the fence always covers both targets
  double picket_m = 0.04;                           // [0.01, 0.5]: width of a picket
  double least_gap_m = 0.75, greatest_gap_m = 0.9;  // [0.05, 2]: air between two pickets
  double camera_distance_m = 6.0;  // [4, 20]: distance from the targets; the fence stands 2 m before them
  // When a solid board comes up before both targets and stays: a sustained occlusion. [0, duration_s - 0.25]; 0: no
  // board.
  double board_at_s = 0.0;
  CameraMotion limits = {};  // of the camera, m/s and m/s^2, >= 0; 0 leaves the session's limit
};

// A .glb file.
std::vector<std::byte> make_fence(const FenceOptions& options);

}  // namespace sightline::scenes
