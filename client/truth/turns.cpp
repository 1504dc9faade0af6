#include "client/truth/turns.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

namespace sightline {
namespace {

class Turns {
 public:
  Turns(std::span<const CameraFrame> frames, std::span<const glm::dvec3> centers_m, double tick_s)
      : frames_(frames),
        centers_m_(centers_m),
        half_(std::max<size_t>(1, static_cast<size_t>(std::lround(kTurnWindowS / 2 / tick_s)))),
        longest_(static_cast<size_t>(std::lround(kLongestAnswerS / tick_s))) {}

  TurnMetrics measure() const {
    TurnMetrics metrics;
    for (const size_t turn : turns()) {
      const std::optional<size_t> answer = answer_to(turn);
      const bool cut_short = !answer && turn + longest_ + half_ >= frames_.size();
      if (cut_short || jumps_near(turn, answer.value_or(turn + longest_))) continue;
      ++metrics.turns;
      metrics.unanswered += !answer;
      metrics.mean_answer_s += answer ? frames_[*answer].time_s - frames_[turn].time_s : kLongestAnswerS;
    }
    if (metrics.turns > 0) metrics.mean_answer_s /= static_cast<double>(metrics.turns);
    return metrics;
  }

 private:
  size_t window() const { return 2 * half_; }

  glm::dvec3 center_velocity_mps(size_t from, size_t to) const {
    return (centers_m_[to] - centers_m_[from]) / (frames_[to].time_s - frames_[from].time_s);
  }
  glm::dvec3 camera_velocity_mps(size_t from, size_t to) const {
    return (frames_[to].camera.position_m - frames_[from].camera.position_m) /
           (frames_[to].time_s - frames_[from].time_s);
  }

  // The angle by which the targets turn at frame i; 0 when they are too slow.
  double angle_at(size_t i) const {
    const glm::dvec3 before = center_velocity_mps(i - window(), i), after = center_velocity_mps(i, i + window());
    const double slower = std::min(glm::length(before), glm::length(after));
    if (slower < kTurnSpeedMps) return 0.0;
    return std::atan2(glm::length(glm::cross(before, after)), glm::dot(before, after));
  }

  std::vector<size_t> turns() const {
    std::vector<size_t> found;
    double greatest_rad = 0.0;  // of the frames since the last one that does not turn
    for (size_t i = window(); i + window() < frames_.size(); ++i) {
      const double angle_rad = angle_at(i);
      if (angle_rad <= kTurnRad) {
        greatest_rad = 0.0;
        continue;
      }
      if (greatest_rad == 0.0) found.push_back(i);
      if (angle_rad > greatest_rad + 1e-9) {
        greatest_rad = angle_rad;
        found.back() = i;
      }
    }
    return found;
  }

  std::optional<size_t> answer_to(size_t turn) const {
    const glm::dvec3 change_mps = center_velocity_mps(turn, turn + window()) -
                                  center_velocity_mps(turn - window(), turn);
    const glm::dvec3 before_mps = camera_velocity_mps(turn - window(), turn);
    for (size_t j = turn; j <= turn + longest_ && j + half_ < frames_.size(); ++j) {
      const glm::dvec3 made_mps = camera_velocity_mps(j - half_, j + half_) - before_mps;
      if (glm::dot(made_mps, change_mps) >= (0.5 - 1e-9) * glm::dot(change_mps, change_mps)) return j;
    }
    return std::nullopt;
  }

  bool jumps_near(size_t turn, size_t end) const {
    for (size_t j = turn - window(); j <= std::min(end + half_, frames_.size() - 1); ++j)
      if (frames_[j].jump) return true;
    return false;
  }

  const std::span<const CameraFrame> frames_;
  const std::span<const glm::dvec3> centers_m_;
  const size_t half_;     // half of the window, in frames
  const size_t longest_;  // longest time to answer, in frames
};

}  // namespace

TurnMetrics answers_to_turns(std::span<const CameraFrame> frames, std::span<const glm::dvec3> centers_m) {
  if (frames.size() < 2 || !(frames[1].time_s > frames[0].time_s)) return {};
  return Turns(frames, centers_m, frames[1].time_s - frames[0].time_s).measure();
}

}  // namespace sightline
