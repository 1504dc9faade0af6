// Fence (Figure 3 and Table 3 of the paper): two standing targets, and a sparse fence that moves back and
// forth between them and the camera. What it tests: temporal stability. Each picket hides a part of a target
// for a moment only, so a camera that answers to each of them never rests.
//
// What a filter of 6 in 10 can calm is an occluder of which the camera sees both targets in at least 6 of any
// 10 steps; the fence is made for that, and each choice serves it:
//   sparse  a picket of 4 cm before 75 to 90 cm of air: one sampled point of a target in twenty is hidden, both
//           targets are seen in nine steps of ten. At 33 % of wood, two in five are hidden all the time, no
//           share of any window is steady, and every filter moves the camera more than none.
//   fast    3 m/s: a target's width has passed behind a picket within 9 steps of 1/60 s; what is hidden spreads
//           over the steps instead of coming in a row.
//   sharp   it bounces off its stops at full speed. A pendulum lingers at its turns, where a picket would stay
//           before one target for a third of a second.
//   late    it stands for the first quarter of a second, with air before both targets: a filter counts over
//           the steps that it has, and one hidden step out of one is all there is.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace sightline::scenes {

struct FenceOptions {
  uint64_t seed = 1;
  double duration_s = 10.0;  // [1, 600]
  double period_s = 1.2;     // [0.5, 60]: once to and fro
  double amplitude_m = 0.9;  // [0, 2]: to each side; the fence always covers both targets
  double picket_m = 0.04;    // [0.01, 0.5]: how wide a picket is
  double least_gap_m = 0.75, greatest_gap_m = 0.9;  // [0.05, 2]: air between two pickets
  double camera_distance_m = 6.0;  // [4, 20]: from the targets; the fence stands 2 m before them
  // From when on a solid board stands before both targets: an occlusion that lasts. [0, duration_s - 0.25]; 0: none ever.
  double board_at_s = 0.0;
};

// A .glb file.
std::vector<std::byte> make_fence(const FenceOptions& options);

}  // namespace sightline::scenes
