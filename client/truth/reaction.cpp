#include "client/truth/reaction.h"

#include <algorithm>

#include "client/truth/metrics.h"

namespace sightline {
namespace {

class Reactions {
 public:
  Reactions(ScenarioWorld& world, std::span<const CameraFrame> frames) : world_(world), frames_(frames) {
    for (const CameraFrame& frame : frames) {
      world.set_time(frame.time_s);
      centers_m_.push_back(world.targets_center_m());
      std::vector<bool>& hidden = hidden_.emplace_back();
      for (const Target& target : world.targets())
        hidden.push_back(world.is_aim_hidden(target, frame.camera.position_m));
    }
  }

  ReactionMetrics measure() {
    ReactionMetrics metrics;
    std::vector<double>& delays = metrics.delays_s;
    for (size_t k = 0; k < world_.targets().size(); ++k)
      for (size_t i = 2; i < frames_.size(); ++i) {
        if (!hidden_[i][k] || hidden_[i - 1][k] || frames_[i].jump || !is_sustained(i, k)) continue;
        const size_t reaction = reaction_to(i, k);
        delays.push_back(frames_[reaction].time_s - frames_[i].time_s);
        metrics.unanswered += !has_reacted(i, k, reaction);
        metrics.mean_regain_s += frames_[free_again(i, k)].time_s - frames_[i].time_s;
      }
    metrics.occlusions = delays.size();
    if (!delays.empty()) metrics.mean_regain_s /= static_cast<double>(delays.size());
    for (const double delay : delays) metrics.mean_delay_s += delay / static_cast<double>(delays.size());
    metrics.p95_delay_s = percentile(delays, 0.95);
    return metrics;
  }

 private:
  // True when the line stays blocked for a camera that keeps its offset from the targets.
  bool is_sustained(size_t onset, size_t k) {
    const glm::dvec3 offset_m = frames_[onset].camera.position_m - centers_m_[onset];
    for (size_t j = onset; j < frames_.size(); ++j) {
      world_.set_time(frames_[j].time_s);
      if (!world_.is_aim_hidden(world_.targets()[k], centers_m_[j] + offset_m)) return false;
      if (frames_[j].time_s - frames_[onset].time_s >= kSustainedS - 1e-9) return true;
    }
    return false;
  }

  glm::dvec3 relative_velocity(size_t j) const {
    const double dt_s = frames_[j].time_s - frames_[j - 1].time_s;
    if (!(dt_s > 0)) return glm::dvec3(0.0);
    return (frames_[j].camera.position_m - centers_m_[j] - frames_[j - 1].camera.position_m + centers_m_[j - 1]) / dt_s;
  }

  bool has_reacted(size_t onset, size_t k, size_t j) const {
    return !hidden_[j][k] || glm::distance(relative_velocity(j), relative_velocity(onset - 1)) > kReactionMps;
  }

  size_t free_again(size_t onset, size_t k) const {
    size_t j = onset;
    while (j + 1 < frames_.size() && hidden_[j][k]) ++j;
    return j;
  }

  size_t reaction_to(size_t onset, size_t k) const {
    size_t j = onset;
    while (j + 1 < frames_.size() && !has_reacted(onset, k, j) &&
           frames_[j].time_s - frames_[onset].time_s < kLongestReactionS - 1e-9)
      ++j;
    return j;
  }

  ScenarioWorld& world_;
  const std::span<const CameraFrame> frames_;
  std::vector<glm::dvec3> centers_m_;
  std::vector<std::vector<bool>> hidden_;  // by frame, by target
};

}  // namespace

ReactionMetrics measure_reaction(ScenarioWorld& world, std::span<const CameraFrame> frames) {
  return Reactions(world, frames).measure();
}

}  // namespace sightline
