#include "client/truth/metrics.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "client/truth/blindness.h"

namespace sightline {
namespace {

using Run = RunMetrics;
constexpr RunFigure kFigures[] = {
    {"frames", [](const Run& r) { return double(r.frames); }},
    {"pictures", [](const Run& r) { return double(r.pictures); }},
    {"joint_visible_share", [](const Run& r) { return r.joint_visible_share(); }},
    {"joint_whole_share", [](const Run& r) { return r.joint_whole_share; }},
    {"mean_whole_share", [](const Run& r) { return r.mean_whole_share; }},
    {"p95_size_pictures", [](const Run& r) { return r.p95_size_pictures; }},
    {"all_seen", [](const Run& r) { return r.all_seen; }},
    {"mean_visible_share", [](const Run& r) { return r.mean_visible_share; }},
    {"mean_hidden_share", [](const Run& r) { return r.mean_hidden_share; }},
    {"in_frame_share", [](const Run& r) { return r.in_frame_share; }},
    {"r_n", [](const Run& r) { return r.r_n; }},
    {"r_p", [](const Run& r) { return r.r_p; }},
    {"r_p_tolerant", [](const Run& r) { return r.r_p_tolerant; }},
    {"episodes", [](const Run& r) { return double(r.episodes.count); }},
    {"p95_episode_s", [](const Run& r) { return r.episodes.p95_length_s; }},
    {"mean_reacquire_s", [](const Run& r) { return r.episodes.mean_reacquire_s; }},
    {"never_reacquired", [](const Run& r) { return double(r.episodes.never_reacquired); }},
    {"longest_blind_s", [](const Run& r) { return r.longest_blind_s; }},
    {"d_c_m", [](const Run& r) { return r.d_c_m; }},
    {"d_s_heights", [](const Run& r) { return r.d_s_heights; }},
    {"rms_acceleration_mps2", [](const Run& r) { return r.rms_acceleration_mps2; }},
    {"peak_acceleration_mps2", [](const Run& r) { return r.peak_acceleration_mps2; }},
    {"rms_jerk_mps3", [](const Run& r) { return r.rms_jerk_mps3; }},
    {"p99_jerk_mps3", [](const Run& r) { return r.p99_jerk_mps3; }},
    {"peak_jerk_mps3", [](const Run& r) { return r.peak_jerk_mps3; }},
    {"peak_speed_mps", [](const Run& r) { return r.peak_speed_mps; }},
    {"peak_angular_speed_radps", [](const Run& r) { return r.peak_angular_speed_radps; }},
    {"peak_angular_acceleration_radps2", [](const Run& r) { return r.peak_angular_acceleration_radps2; }},
    {"acceleration_limit_share", [](const Run& r) { return r.acceleration_limit_share; }},
    {"speed_limit_share", [](const Run& r) { return r.speed_limit_share; }},
    {"reversals_per_s", [](const Run& r) { return r.reversals_per_s; }},
    {"body_collisions", [](const Run& r) { return double(r.body_collisions); }},
    {"least_clearance_m", [](const Run& r) { return r.least_clearance_m; }},
    {"limit_violations", [](const Run& r) { return double(r.limit_violations); }},
};

void add_travel(std::span<const CameraFrame> frames, std::span<const FrameTruth> truths, RunMetrics& metrics) {
  for (size_t i = 1; i < frames.size(); ++i) {
    if (frames[i].jump) continue;
    metrics.d_c_m += glm::distance(frames[i].camera.position_m, frames[i - 1].camera.position_m);
    if (truths.empty() || truths[i].other_targets) continue;
    const auto &before = truths[i - 1].centers, &now = truths[i].centers;
    for (size_t k = 0; k < std::min(before.size(), now.size()); ++k)
      if (before[k] && now[k]) metrics.d_s_heights += glm::distance(*before[k], *now[k]);
  }
}

// Turns the sums of squares and of frames at a limit into means.
void divide_by_samples(size_t samples, size_t jerks, RunMetrics& metrics) {
  const auto divide = [](double& sum, size_t n) { sum /= static_cast<double>(std::max<size_t>(n, 1)); };
  divide(metrics.acceleration_limit_share, samples);
  divide(metrics.speed_limit_share, samples);
  divide(metrics.rms_acceleration_mps2, samples);
  divide(metrics.rms_jerk_mps3, jerks);
  metrics.rms_acceleration_mps2 = std::sqrt(metrics.rms_acceleration_mps2);
  metrics.rms_jerk_mps3 = std::sqrt(metrics.rms_jerk_mps3);
}

void add_motion(std::span<const CameraFrame> frames, const CameraLimits& limits, RunMetrics& metrics) {
  size_t samples = 0;
  std::vector<double> jerks_mps3;
  for (const MotionSample& sample : motion_of(frames)) {
    if (!sample.valid) continue;
    ++samples;
    if (breaks_limits(sample, limits)) ++metrics.limit_violations;
    metrics.acceleration_limit_share += sample.acceleration_mps2 >= kAtLimit * limits.max_acceleration_mps2;
    metrics.speed_limit_share += sample.speed_mps >= kAtLimit * limits.max_speed_mps;
    const auto raise = [](double& peak, double value) { peak = std::max(peak, value); };
    raise(metrics.peak_speed_mps, sample.speed_mps);
    raise(metrics.peak_acceleration_mps2, sample.acceleration_mps2);
    raise(metrics.peak_angular_speed_radps, sample.angular_speed_radps);
    raise(metrics.peak_angular_acceleration_radps2, sample.angular_acceleration_radps2);
    metrics.rms_acceleration_mps2 += sample.acceleration_mps2 * sample.acceleration_mps2;
    if (!sample.has_jerk) continue;
    jerks_mps3.push_back(sample.jerk_mps3);
    raise(metrics.peak_jerk_mps3, sample.jerk_mps3);
    metrics.rms_jerk_mps3 += sample.jerk_mps3 * sample.jerk_mps3;
  }
  divide_by_samples(samples, jerks_mps3.size(), metrics);
  metrics.p99_jerk_mps3 = percentile(std::move(jerks_mps3), 0.99);
  const double length_s = frames.empty() ? 0.0 : frames.back().time_s - frames.front().time_s;
  if (length_s > 0) metrics.reversals_per_s = static_cast<double>(direction_reversals(frames)) / length_s;
}

void add_bodies(std::span<const FrameTruth> truths, double body_radius_m, RunMetrics& metrics) {
  metrics.least_clearance_m = truths.empty() ? 0.0 : BodyTruth::kReachM;
  for (const FrameTruth& truth : truths) {
    if (truth.body.touches(body_radius_m)) ++metrics.body_collisions;
    metrics.least_clearance_m = std::min<double>(metrics.least_clearance_m, truth.body.clearance_m);
  }
}

// The index into metrics.targets; its size when the id is not there.
size_t index_of(uint64_t target_id, const RunMetrics& metrics) {
  const auto is_it = [target_id](const TargetMetrics& target) { return target.id == target_id; };
  return static_cast<size_t>(std::find_if(metrics.targets.begin(), metrics.targets.end(), is_it) -
                             metrics.targets.begin());
}

void add_picture(const PictureTruth& picture, RunMetrics& metrics) {
  ++metrics.pictures;
  metrics.r_n += picture.fully_hidden();
  metrics.r_p += picture.partly_hidden();
  metrics.r_p_tolerant += picture.partly_hidden(kPartialTolerance);
  metrics.all_seen += picture.all_seen();
  metrics.joint_whole_share += picture.all_whole();
  for (const TargetTruth& target : picture.targets) {
    const size_t k = index_of(target.id, metrics);
    if (k == metrics.targets.size()) continue;
    TargetMetrics& sums = metrics.targets[k];
    ++sums.pictures;
    sums.mean_visible_share += target.visible_share();
    sums.mean_whole_share += target.whole_share();
    sums.in_frame_share += target.in_frame;
  }
}

// Turns sums over pictures into means.
void divide_by_pictures(RunMetrics& metrics) {
  if (metrics.pictures == 0) return;
  const double n = static_cast<double>(metrics.pictures);
  for (double* sum : {&metrics.r_n, &metrics.r_p, &metrics.r_p_tolerant, &metrics.all_seen, &metrics.joint_whole_share})
    *sum /= n;
  for (TargetMetrics& target : metrics.targets) {
    const double own = static_cast<double>(std::max<size_t>(target.pictures, 1));
    target.mean_visible_share /= own;
    target.mean_whole_share /= own;
    metrics.mean_whole_share += target.mean_whole_share / static_cast<double>(metrics.targets.size());
    target.in_frame_share /= own;
    metrics.mean_visible_share += target.mean_visible_share / static_cast<double>(metrics.targets.size());
    metrics.in_frame_share += target.in_frame_share / static_cast<double>(metrics.targets.size());
  }
}

void add_sight(std::span<const CameraFrame> frames, std::span<const FrameTruth> truths, RunMetrics& metrics) {
  std::vector<std::vector<SightSample>> sights(metrics.targets.size());
  std::vector<double> sizes_pictures;
  double hidden = 0.0;
  size_t pairs = 0;
  for (size_t i = 0; i < truths.size(); ++i) {
    if (!truths[i].picture) continue;
    add_picture(*truths[i].picture, metrics);
    double largest_pictures = 0.0;
    for (const TargetTruth& target : truths[i].picture->targets)
      largest_pictures = std::max(largest_pictures, target.outline.height_pictures);
    sizes_pictures.push_back(largest_pictures);
    for (const TargetTruth& target : truths[i].picture->targets) {
      const size_t k = index_of(target.id, metrics);
      if (k == sights.size()) continue;
      sights[k].push_back({frames[i].time_s, target.visible_share()});
      if (target.alone_pixels == 0) continue;
      hidden += 1.0 - target.visible_share();
      ++pairs;
    }
  }
  divide_by_pictures(metrics);
  metrics.mean_hidden_share = pairs == 0 ? 0.0 : hidden / static_cast<double>(pairs);
  metrics.p95_size_pictures = percentile(std::move(sizes_pictures), 0.95);
  metrics.episodes = episodes_of(sights);
  for (const BlindStretch& stretch : blind_stretches(frames, truths))
    metrics.longest_blind_s = std::max(metrics.longest_blind_s, stretch.length_s(frames));
}

// The first index from `from` on for which `wanted` is true; the last index when there is none.
template <typename Wanted>
size_t first_where(const std::vector<SightSample>& samples, size_t from, Wanted wanted) {
  size_t i = from;
  while (i + 1 < samples.size() && !wanted(samples[i])) ++i;
  return i;
}

}  // namespace

// Rounded to a whole number of pictures, so that runs compare without rounding errors.
double RunMetrics::joint_visible_share() const {
  if (pictures == 0) return 0.0;
  const double n = static_cast<double>(pictures);
  return std::round((1.0 - r_n - r_p_tolerant) * n) / n;
}

EpisodeMetrics episodes_of(std::span<const std::vector<SightSample>> targets) {
  EpisodeMetrics metrics;
  std::vector<double> lengths;
  const auto seen = [](const SightSample& s) { return s.visible_share > 0.0; };
  const auto clear = [](const SightSample& s) { return s.visible_share >= 1.0 - kPartialTolerance; };
  for (const std::vector<SightSample>& samples : targets)
    for (size_t i = 0; i < samples.size(); ++i) {
      if (seen(samples[i])) continue;
      const size_t end = first_where(samples, i, seen), regained = first_where(samples, i, clear);
      lengths.push_back(samples[end].time_s - samples[i].time_s);
      metrics.mean_reacquire_s += samples[regained].time_s - samples[i].time_s;
      metrics.never_reacquired += !clear(samples[regained]);
      i = end;
    }
  metrics.count = lengths.size();
  if (metrics.count > 0) metrics.mean_reacquire_s /= static_cast<double>(metrics.count);
  metrics.p95_length_s = percentile(std::move(lengths), 0.95);
  return metrics;
}

RunMetrics summarize(const Scenario& scenario, std::span<const CameraFrame> frames, std::span<const FrameTruth> truths,
                     const CameraLimits& limits) {
  std::vector<TargetMetrics> targets;
  for (const ScenarioActor& target : scenario.targets())
    if (target.weight > 0.0) targets.push_back({.id = target.id, .name = target.name});
  return summarize(std::move(targets), frames, truths, limits);
}

RunMetrics summarize(std::vector<TargetMetrics> targets, std::span<const CameraFrame> frames,
                     std::span<const FrameTruth> truths, const CameraLimits& limits) {
  RunMetrics metrics;
  metrics.frames = frames.size();
  metrics.targets = std::move(targets);
  add_sight(frames, truths, metrics);
  add_bodies(truths, limits.body_radius_m, metrics);
  add_travel(frames, truths, metrics);
  add_motion(frames, limits, metrics);
  return metrics;
}

std::span<const RunFigure> run_figures() {
  return kFigures;
}

std::string to_json(const RunMetrics& metrics) {
  nlohmann::ordered_json json;
  for (const RunFigure& figure : kFigures) json[std::string(figure.name)] = figure.of(metrics);
  json["targets"] = nlohmann::ordered_json::array();
  for (const TargetMetrics& target : metrics.targets)
    json["targets"].push_back({{"id", target.id},
                               {"name", target.name},
                               {"mean_visible_share", target.mean_visible_share},
                               {"mean_whole_share", target.mean_whole_share},
                               {"in_frame_share", target.in_frame_share}});
  return json.dump(2);
}

double percentile(std::vector<double> values, double p) {
  if (values.empty()) return 0.0;
  const auto rank = static_cast<size_t>(std::ceil(p * static_cast<double>(values.size())));
  const size_t index = std::clamp<size_t>(rank, 1, values.size()) - 1;
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(index), values.end());
  return values[index];
}

}  // namespace sightline
