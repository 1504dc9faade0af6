#include "client/metrics.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

namespace sightline {
namespace {

struct Heading {
  double yaw_rad = 0.0, pitch_rad = 0.0;
};

// Of a camera without roll. Yaw is taken from its right-hand side, which stays level even straight up or
// down.
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

// What has to be remembered to take differences.
struct Rates {
  glm::dvec3 velocity_mps{0.0};
  double yaw_radps = 0.0, pitch_radps = 0.0;
};

Rates rates_between(const CameraFrame& before, const CameraFrame& now, double dt_s) {
  const Heading from = heading_of(before.camera.rotation), to = heading_of(now.camera.rotation);
  return {(now.camera.position_m - before.camera.position_m) / dt_s,
          wrapped(to.yaw_rad - from.yaw_rad) / dt_s, (to.pitch_rad - from.pitch_rad) / dt_s};
}

MotionSample sample_of(const Rates& before, const Rates& now, double dt_s) {
  MotionSample sample;
  sample.valid = true;
  sample.speed_mps = glm::length(now.velocity_mps);
  sample.acceleration_mps2 = glm::length(now.velocity_mps - before.velocity_mps) / dt_s;
  sample.angular_speed_radps = std::hypot(now.yaw_radps, now.pitch_radps);
  sample.angular_acceleration_radps2 =
      std::hypot(now.yaw_radps - before.yaw_radps, now.pitch_radps - before.pitch_radps) / dt_s;
  return sample;
}

void add_motion(std::span<const CameraFrame> frames, const CameraLimits& limits, RunMetrics& metrics) {
  for (size_t i = 1; i < frames.size(); ++i)
    if (!frames[i].jump)
      metrics.d_c_m += glm::distance(frames[i].camera.position_m, frames[i - 1].camera.position_m);
  for (const MotionSample& sample : motion_of(frames)) {
    if (!sample.valid) continue;
    if (breaks_limits(sample, limits)) ++metrics.limit_violations;
    const auto raise = [](double& peak, double value) { peak = std::max(peak, value); };
    raise(metrics.peak_speed_mps, sample.speed_mps);
    raise(metrics.peak_acceleration_mps2, sample.acceleration_mps2);
    raise(metrics.peak_angular_speed_radps, sample.angular_speed_radps);
    raise(metrics.peak_angular_acceleration_radps2, sample.angular_acceleration_radps2);
  }
}

void add_bodies(std::span<const FrameTruth> truths, double body_radius_m, RunMetrics& metrics) {
  metrics.least_clearance_m = truths.empty() ? 0.0 : BodyTruth::kReachM;
  for (const FrameTruth& truth : truths) {
    if (truth.body.touches(body_radius_m)) ++metrics.body_collisions;
    metrics.least_clearance_m = std::min<double>(metrics.least_clearance_m, truth.body.clearance_m);
  }
}

void add_picture(const PictureTruth& picture, RunMetrics& metrics) {
  ++metrics.pictures;
  metrics.r_n += picture.fully_hidden();
  metrics.r_p += picture.partly_hidden();
  metrics.r_p_tolerant += picture.partly_hidden(kPartialTolerance);
  metrics.all_seen += picture.all_seen();
  for (size_t k = 0; k < picture.targets.size(); ++k) {
    metrics.targets[k].mean_visible_share += picture.targets[k].visible_share();
    metrics.targets[k].in_frame_share += picture.targets[k].in_frame;
  }
}

// Sums over pictures become means.
void divide_by_pictures(RunMetrics& metrics) {
  if (metrics.pictures == 0) return;
  const double n = static_cast<double>(metrics.pictures);
  for (double* sum : {&metrics.r_n, &metrics.r_p, &metrics.r_p_tolerant, &metrics.all_seen}) *sum /= n;
  for (TargetMetrics& target : metrics.targets) {
    target.mean_visible_share /= n;
    target.in_frame_share /= n;
    metrics.mean_visible_share += target.mean_visible_share / static_cast<double>(metrics.targets.size());
  }
}

}  // namespace

std::vector<MotionSample> motion_of(std::span<const CameraFrame> frames) {
  std::vector<MotionSample> samples(frames.size());
  Rates before;
  for (size_t i = 1; i < frames.size(); ++i) {
    const double dt_s = frames[i].time_s - frames[i - 1].time_s;
    if (!(dt_s > 0)) continue;
    const Rates now = rates_between(frames[i - 1], frames[i], dt_s);
    // Neither the jump itself nor the change of velocity right after it says anything.
    if (!frames[i].jump && !frames[i - 1].jump) samples[i] = sample_of(before, now, dt_s);
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

RunMetrics summarize(const Scenario& scenario, std::span<const CameraFrame> frames,
                     std::span<const FrameTruth> truths, const CameraLimits& limits) {
  RunMetrics metrics;
  metrics.frames = frames.size();
  for (const ScenarioActor& target : scenario.targets())
    if (target.weight > 0.0) metrics.targets.push_back({target.id, target.name, 0.0, 0.0});
  for (const FrameTruth& truth : truths)
    if (truth.picture) add_picture(*truth.picture, metrics);
  divide_by_pictures(metrics);
  add_bodies(truths, limits.body_radius_m, metrics);
  add_motion(frames, limits, metrics);
  return metrics;
}

std::string to_json(const RunMetrics& metrics) {
  nlohmann::ordered_json targets = nlohmann::ordered_json::array();
  for (const TargetMetrics& target : metrics.targets)
    targets.push_back({{"id", target.id},
                       {"name", target.name},
                       {"mean_visible_share", target.mean_visible_share},
                       {"in_frame_share", target.in_frame_share}});
  const nlohmann::ordered_json json = {
      {"frames", metrics.frames},
      {"pictures", metrics.pictures},
      {"targets", targets},
      {"mean_visible_share", metrics.mean_visible_share},
      {"r_n", metrics.r_n},
      {"r_p", metrics.r_p},
      {"r_p_tolerant", metrics.r_p_tolerant},
      {"all_seen", metrics.all_seen},
      {"all_clear", metrics.all_clear()},
      {"body_collisions", metrics.body_collisions},
      {"least_clearance_m", metrics.least_clearance_m},
      {"limit_violations", metrics.limit_violations},
      {"d_c_m", metrics.d_c_m},
      {"peak_speed_mps", metrics.peak_speed_mps},
      {"peak_acceleration_mps2", metrics.peak_acceleration_mps2},
      {"peak_angular_speed_radps", metrics.peak_angular_speed_radps},
      {"peak_angular_acceleration_radps2", metrics.peak_angular_acceleration_radps2}};
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
