// Changes of subject: how soon a camera shows the new targets as it was asked to.
#pragma once

#include <span>

#include "client/truth/coherence.h"

namespace sightline {

// A change is a frame with other targets than the frame before. Its answer is the first judged picture from there on
// that shows every target whole while the frame keeps its shot (kKeptDeviation). It counts up to the next change, or to
// the end of the run; a change without an answer counts with all of that time.
struct ChangeMetrics {
  size_t changes = 0, unanswered = 0;
  double mean_answer_s = 0.0, longest_answer_s = 0.0;
};
// `shots` and `truths` are as long as `frames`. `tolerance` as in deviation_between.
ChangeMetrics answers_to_changes(std::span<const CameraFrame> frames, std::span<const FrameShot> shots,
                                 std::span<const FrameTruth> truths, double tolerance = 1.0);

}  // namespace sightline
