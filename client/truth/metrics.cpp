#include "client/truth/metrics.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

namespace sightline {
namespace {

using Run = RunMetrics;
constexpr RunFigure kFigures[] = {
    {"frames", [](const Run& r) { return double(r.frames); }},
    {"pictures", [](const Run& r) { return double(r.pictures); }},
    {"joint_visible_share", [](const Run& r) { return r.joint_visible_share(); }},
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
    {"d_c_m", [](const Run& r) { return r.d_c_m; }},
    {"d_s_heights", [](const Run& r) { return r.d_s_heights; }},
    {"rms_acceleration_mps2", [](const Run& r) { return r.rms_acceleration_mps2; }},
    {"peak_acceleration_mps2", [](const Run& r) { return r.peak_acceleration_mps2; }},
    {"rms_jerk_mps3", [](const Run& r) { return r.rms_jerk_mps3; }},
    {"peak_jerk_mps3", [](const Run& r) { return r.peak_jerk_mps3; }},
    {"peak_speed_mps", [](const Run& r) { return r.peak_speed_mps; }},
    {"peak_angular_speed_radps", [](const Run& r) { return r.peak_angular_speed_radps; }},
    {"peak_angular_acceleration_radps2", [](const Run& r) { return r.peak_angular_acceleration_radps2; }},
    {"pops", [](const Run& r) { return double(r.pops); }},
    {"body_collisions", [](const Run& r) { return double(r.body_collisions); }},
    {"least_clearance_m", [](const Run& r) { return r.least_clearance_m; }},
    {"limit_violations", [](const Run& r) { return double(r.limit_violations); }},
};

struct Heading {
  double yaw_rad = 0.0, pitch_rad = 0.0;
};

// The heading of a camera without roll. Yaw comes from its right axis, which stays level even when it looks straight up or down.
Heading heading_of(const glm::dquat& rotation) {
  const glm::dvec3 right = rotation * glm::dvec3(1, 0, 0), forward = rotation * glm::dvec3(0, 0, -1);
  const glm::dvec3 ahead(right.z, 0.0, -right.x);  // level, at a right angle to `right`
  return {std::atan2(-right.z, right.x), std::atan2(forward.y, glm::dot(forward, ahead))};
}

double wrapped(double angle_rad) {
  return std::remainder(angle_rad, 2 * std::numbers::pi);
}

bool exceeds(double value, double limit, double slack) {
  return value > limit * (1 + slack) + slack;
}

// The rates at one frame; the next frame takes differences of them.
struct Rates {
  glm::dvec3 velocity_mps{0.0};
  double yaw_radps = 0.0, pitch_radps = 0.0;
  glm::dvec3 acceleration_mps2{0.0};
};

Rates rates_between(const CameraFrame& before, const CameraFrame& now, double dt_s) {
  const Heading from = heading_of(before.camera.rotation), to = heading_of(now.camera.rotation);
  return {(now.camera.position_m - before.camera.position_m) / dt_s,
          wrapped(to.yaw_rad - from.yaw_rad) / dt_s, (to.pitch_rad - from.pitch_rad) / dt_s, glm::dvec3(0.0)};
}

MotionSample sample_of(const Rates& before, const Rates& now, double dt_s) {
  MotionSample sample;
  sample.valid = true;
  sample.speed_mps = glm::length(now.velocity_mps);
  sample.acceleration_mps2 = glm::length(now.acceleration_mps2);
  sample.jerk_mps3 = glm::length(now.acceleration_mps2 - before.acceleration_mps2) / dt_s;
  sample.angular_speed_radps = std::hypot(now.yaw_radps, now.pitch_radps);
  sample.angular_acceleration_radps2 =
      std::hypot(now.yaw_radps - before.yaw_radps, now.pitch_radps - before.pitch_radps) / dt_s;
  return sample;
}

bool pops(const CameraFrame& before, const CameraFrame& now) {
  return glm::distance(now.camera.position_m, before.camera.position_m) > kPopM ||
         angle_between(now.camera.rotation, before.camera.rotation) > kPopRad;
}

void add_travel(std::span<const CameraFrame> frames, std::span<const FrameTruth> truths,
                RunMetrics& metrics) {
  for (size_t i = 1; i < frames.size(); ++i) {
    if (frames[i].jump) continue;
    metrics.d_c_m += glm::distance(frames[i].camera.position_m, frames[i - 1].camera.position_m);
    metrics.pops += pops(frames[i - 1], frames[i]);
    if (truths.empty()) continue;
    const auto &before = truths[i - 1].centers, &now = truths[i].centers;
    for (size_t k = 0; k < std::min(before.size(), now.size()); ++k)
      if (before[k] && now[k]) metrics.d_s_heights += glm::distance(*before[k], *now[k]);
  }
}

void add_motion(std::span<const CameraFrame> frames, const CameraLimits& limits, RunMetrics& metrics) {
  size_t accelerations = 0, jerks = 0;
  for (const MotionSample& sample : motion_of(frames)) {
    if (!sample.valid) continue;
    if (breaks_limits(sample, limits)) ++metrics.limit_violations;
    const auto raise = [](double& peak, double value) { peak = std::max(peak, value); };
    raise(metrics.peak_speed_mps, sample.speed_mps);
    raise(metrics.peak_acceleration_mps2, sample.acceleration_mps2);
    raise(metrics.peak_angular_speed_radps, sample.angular_speed_radps);
    raise(metrics.peak_angular_acceleration_radps2, sample.angular_acceleration_radps2);
    metrics.rms_acceleration_mps2 += sample.acceleration_mps2 * sample.acceleration_mps2;
    ++accelerations;
    if (!sample.has_jerk) continue;
    raise(metrics.peak_jerk_mps3, sample.jerk_mps3);
    metrics.rms_jerk_mps3 += sample.jerk_mps3 * sample.jerk_mps3;
    ++jerks;
  }
  const auto root_of_mean = [](double sum, size_t n) { return std::sqrt(sum / std::max<size_t>(n, 1)); };
  metrics.rms_acceleration_mps2 = root_of_mean(metrics.rms_acceleration_mps2, accelerations);
  metrics.rms_jerk_mps3 = root_of_mean(metrics.rms_jerk_mps3, jerks);
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
  for (const TargetTruth& target : picture.targets) {
    const size_t k = index_of(target.id, metrics);
    if (k == metrics.targets.size()) continue;
    TargetMetrics& sums = metrics.targets[k];
    ++sums.pictures;
    sums.mean_visible_share += target.visible_share();
    sums.in_frame_share += target.in_frame;
  }
}

// Turns sums over pictures into means.
void divide_by_pictures(RunMetrics& metrics) {
  if (metrics.pictures == 0) return;
  const double n = static_cast<double>(metrics.pictures);
  for (double* sum : {&metrics.r_n, &metrics.r_p, &metrics.r_p_tolerant, &metrics.all_seen}) *sum /= n;
  for (TargetMetrics& target : metrics.targets) {
    const double own = static_cast<double>(std::max<size_t>(target.pictures, 1));
    target.mean_visible_share /= own;
    target.in_frame_share /= own;
    metrics.mean_visible_share += target.mean_visible_share / static_cast<double>(metrics.targets.size());
    metrics.in_frame_share += target.in_frame_share / static_cast<double>(metrics.targets.size());
  }
}

void add_sight(std::span<const CameraFrame> frames, std::span<const FrameTruth> truths, RunMetrics& metrics) {
  std::vector<std::vector<SightSample>> sights(metrics.targets.size());
  double hidden = 0.0;
  size_t pairs = 0;
  for (size_t i = 0; i < truths.size(); ++i) {
    if (!truths[i].picture) continue;
    add_picture(*truths[i].picture, metrics);
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
  metrics.episodes = episodes_of(sights);
}

void add_report(double said, double truth, ReportErrors& sums) {
  sums.false_visible += said >= 0.5 && truth < 0.5;
  sums.false_occluded += said < 0.5 && truth >= 0.5;
  sums.mean_absolute_error += std::abs(said - truth);
}

// Turns sums over pairs into shares and a mean.
void divide_by_pairs(const ReportMetrics& metrics, ReportErrors& errors) {
  const auto divide = [](double& sum, size_t n) { sum = n == 0 ? 0.0 : sum / static_cast<double>(n); };
  divide(errors.false_visible, metrics.hidden_pairs);
  divide(errors.false_occluded, metrics.pairs - metrics.hidden_pairs);
  divide(errors.mean_absolute_error, metrics.pairs);
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

std::vector<MotionSample> motion_of(std::span<const CameraFrame> frames) {
  std::vector<MotionSample> samples(frames.size());
  Rates before;
  for (size_t i = 1; i < frames.size(); ++i) {
    const double dt_s = frames[i].time_s - frames[i - 1].time_s;
    if (!(dt_s > 0)) continue;
    Rates now = rates_between(frames[i - 1], frames[i], dt_s);
    now.acceleration_mps2 = (now.velocity_mps - before.velocity_mps) / dt_s;
    // Neither the jump nor the change of velocity right after it is a motion.
    if (!frames[i].jump && !frames[i - 1].jump) samples[i] = sample_of(before, now, dt_s);
    samples[i].has_jerk = samples[i].valid && (i == 1 || samples[i - 1].valid);
    before = now;
  }
  return samples;
}

bool breaks_limits(const MotionSample& sample, const CameraLimits& limits) {
  constexpr double kSlack = 1e-6, kAngleSlack = 1e-4;
  return exceeds(sample.speed_mps, limits.max_speed_mps, kSlack) ||
         exceeds(sample.acceleration_mps2, limits.max_acceleration_mps2, kSlack) ||
         exceeds(sample.angular_speed_radps, limits.max_angular_speed_radps, kAngleSlack) ||
         exceeds(sample.angular_acceleration_radps2, limits.max_angular_acceleration_radps2, kAngleSlack);
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

ReportMetrics judge_reports(std::span<const FrameTruth> truths,
                            std::span<const std::vector<ReportedShare>> reports) {
  ReportMetrics metrics;
  for (size_t i = 0; i < truths.size(); ++i) {
    if (!truths[i].picture) continue;
    for (const TargetTruth& target : truths[i].picture->targets) {
      const auto report = std::find_if(reports[i].begin(), reports[i].end(),
                                       [&](const ReportedShare& r) { return r.id == target.id; });
      if (report == reports[i].end() || target.alone_pixels == 0) continue;
      ++metrics.pairs;
      metrics.hidden_pairs += target.visible_share() < 0.5;
      add_report(report->visible_share, target.visible_share(), metrics.visible);
      add_report(report->filtered_share, target.visible_share(), metrics.filtered);
    }
  }
  divide_by_pairs(metrics, metrics.visible);
  divide_by_pairs(metrics, metrics.filtered);
  return metrics;
}

RunMetrics summarize(const Scenario& scenario, std::span<const CameraFrame> frames,
                     std::span<const FrameTruth> truths, const CameraLimits& limits) {
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
