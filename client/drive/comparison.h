// The plain follow camera and Sightline's side by side, at the moments that show the difference best.
#pragma once

#include <span>
#include <vector>

#include "client/page/picture.h"
#include "client/scenario/scenario_world.h"
#include "client/truth/judge.h"

namespace sightline {

// Indices of up to `count` frames to show, in order of time. Each is the middle of a run of judged frames that shows
// the difference; the longest runs are taken. In such a run the follow camera shows less than 5 % of the whole body of
// some target, and Sightline shows at least 95 % of every target's. Without such a run, the result is the frame at
// which the least shares differ most. Both spans judge the same frames; the result is empty when none was judged.
std::vector<size_t> telling_frames(std::span<const FrameTruth> follow, std::span<const FrameTruth> sightline,
                                   size_t count);

// The follow camera's pictures in a row, and Sightline's of the same moments in a row below, each `width` pixels wide.
// Both spans have the same length, at least 1. `world` is left at the time of the last frame.
Picture comparison(ScenarioWorld& world, std::span<const CameraFrame> follow, std::span<const CameraFrame> sightline,
                   int width);

}  // namespace sightline
