// The stretches of a run in which the camera sees no target.
#pragma once

#include <span>
#include <vector>

#include "client/truth/judge.h"

namespace sightline {

// A maximal run of judged pictures that hold no pixel of any target (r_N of truth.h). Frames without a picture are
// passed over.
struct BlindStretch {
  size_t first = 0;  // index of the frame with its first picture
  size_t end = 0;    // index of the frame with the next picture that holds a pixel, or with the last picture
  double length_s(std::span<const CameraFrame> frames) const { return frames[end].time_s - frames[first].time_s; }
};
// In the order of time. `truths` is as long as `frames`, or empty.
std::vector<BlindStretch> blind_stretches(std::span<const CameraFrame> frames, std::span<const FrameTruth> truths);

}  // namespace sightline
