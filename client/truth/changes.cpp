#include "client/truth/changes.h"

#include <algorithm>

namespace sightline {
namespace {

bool answers(const FrameShot& shot, const FrameTruth& truth, double tolerance) {
  return truth.picture && truth.picture->all_whole() &&
         largest_of(deviation_between(shot.asked, shot.now, tolerance)) <= kKeptDeviation;
}

}  // namespace

ChangeMetrics answers_to_changes(std::span<const CameraFrame> frames, std::span<const FrameShot> shots,
                                 std::span<const FrameTruth> truths, double tolerance) {
  ChangeMetrics metrics;
  for (size_t change = 1; change < frames.size(); ++change) {
    if (!truths[change].other_targets) continue;
    size_t at = change;
    const auto over = [&] { return at + 1 == frames.size() || truths[at + 1].other_targets; };
    while (!answers(shots[at], truths[at], tolerance) && !over()) ++at;
    const double answer_s = frames[at].time_s - frames[change].time_s;
    ++metrics.changes;
    metrics.unanswered += !answers(shots[at], truths[at], tolerance);
    metrics.mean_answer_s += answer_s;
    metrics.longest_answer_s = std::max(metrics.longest_answer_s, answer_s);
  }
  if (metrics.changes > 0) metrics.mean_answer_s /= static_cast<double>(metrics.changes);
  return metrics;
}

}  // namespace sightline
