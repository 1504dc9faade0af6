#include "client/truth/motion.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace sightline {
namespace {

struct Heading {
  double yaw_rad = 0.0, pitch_rad = 0.0;
};

// The heading of a camera without roll. Yaw comes from its right axis, which stays level even when it looks straight up
// or down.
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
  return {(now.camera.position_m - before.camera.position_m) / dt_s, wrapped(to.yaw_rad - from.yaw_rad) / dt_s,
          (to.pitch_rad - from.pitch_rad) / dt_s, glm::dvec3(0.0)};
}

MotionSample sample_of(const Rates& before, const Rates& now, double dt_s) {
  MotionSample sample;
  sample.valid = true;
  sample.speed_mps = glm::length(now.velocity_mps);
  sample.acceleration_mps2 = glm::length(now.acceleration_mps2);
  sample.jerk_mps3 = glm::length(now.acceleration_mps2 - before.acceleration_mps2) / dt_s;
  sample.angular_speed_radps = std::hypot(now.yaw_radps, now.pitch_radps);
  sample.angular_acceleration_radps2 = std::hypot(now.yaw_radps - before.yaw_radps,
                                                  now.pitch_radps - before.pitch_radps) /
                                       dt_s;
  return sample;
}

// The velocity of one frame.
struct Course {
  double time_s = 0.0;
  glm::dvec3 velocity_mps{0.0};
};

}  // namespace

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

size_t direction_reversals(std::span<const CameraFrame> frames) {
  size_t reversals = 0;
  std::vector<Course> courses;  // within the window, and since the last reversal or jump
  for (size_t i = 1; i < frames.size(); ++i) {
    if (frames[i].jump) courses.clear();
    const double dt_s = frames[i].time_s - frames[i - 1].time_s;
    if (frames[i].jump || !(dt_s > 0)) continue;
    const Course now{frames[i].time_s, (frames[i].camera.position_m - frames[i - 1].camera.position_m) / dt_s};
    if (glm::length(now.velocity_mps) < kReversalSpeedMps) continue;
    std::erase_if(courses, [&](const Course& c) { return now.time_s - c.time_s > kReversalWindowS + 1e-9; });
    const auto is_opposite = [&](const Course& c) { return glm::dot(c.velocity_mps, now.velocity_mps) < 0.0; };
    if (std::any_of(courses.begin(), courses.end(), is_opposite)) {
      ++reversals;
      courses.clear();
    }
    courses.push_back(now);
  }
  return reversals;
}

namespace {

// How far the goal moved between two frames that have one, the motion of the targets' centre taken off.
double goal_moved_m(const GoalSample& before, const GoalSample& now) {
  return glm::distance(*now.goal_m - now.targets_center_m, *before.goal_m - before.targets_center_m);
}

}  // namespace

GoalMetrics goals_of(std::span<const GoalSample> samples) {
  GoalMetrics metrics;
  size_t first = 0;  // of the frames that later ones are compared with
  for (size_t i = 0; i < samples.size(); ++i) {
    const GoalSample& now = samples[i];
    if (!now.goal_m || now.jump) first = now.goal_m ? i : i + 1;
    if (i <= first) continue;
    metrics.watched_s += now.time_s - samples[i - 1].time_s;
    for (size_t k = i; k-- > first;) {
      if (k + 1 < i && now.time_s - samples[k].time_s > kGoalJumpS + 1e-9) break;
      if (goal_moved_m(samples[k], now) <= kGoalJumpM) continue;
      ++metrics.jumps, first = i;
      break;
    }
  }
  if (metrics.watched_s > 0) metrics.jumps_per_s = static_cast<double>(metrics.jumps) / metrics.watched_s;
  return metrics;
}

}  // namespace sightline
