#include "server/move/stop_path.h"

#include <algorithm>
#include <cmath>

#include "server/move/motion.h"

namespace sightline {
namespace {

// Time between two points of the path that are computed, seconds, and the number of them between two corners.
constexpr double kPointS = 1.0 / 60;
constexpr int kPointsPerCorner = 2;
constexpr int kMostPoints = 2000;
// The rest of the path is straight when what is left of the acceleration beside the velocity moves the camera by less than this.
constexpr double kStraightM = 1e-3;

// Path length of a stop on a straight line. The deceleration grows from `braking` to its peak, stays there, and fades until the camera
// stands. A camera that still brakes too hard for its speed is taken to stop where it is.
double braking_stop_m(double speed, double braking, const CameraLimits& limits) {
  const double jerk = limits.max_jerk_mps3;
  const double peak = std::max(braking, std::min(limits.max_acceleration_mps2, std::sqrt(jerk * speed + braking * braking / 2)));
  const double rise_s = (peak - braking) / jerk;
  const double risen = speed - braking * rise_s - jerk * rise_s * rise_s / 2, fading = peak * peak / (2 * jerk);
  return speed * rise_s - braking * rise_s * rise_s / 2 - jerk * rise_s * rise_s * rise_s / 6 +
         std::max(0.0, (risen * risen - fading * fading) / (2 * peak)) + fading * peak / (3 * jerk);
}

// The same for an acceleration forwards, which fades first, or backwards.
double straight_stop_m(double speed, double forward, const CameraLimits& limits) {
  if (forward <= 0) return braking_stop_m(speed, -forward, limits);
  const double fade_s = forward / limits.max_jerk_mps3;
  return speed * fade_s + forward * fade_s * fade_s / 3 + braking_stop_m(speed + forward * fade_s / 2, 0.0, limits);
}

}  // namespace

StopPath::StopPath(const CameraState& camera, const CameraLimits& limits) {
  add(camera.pose.position_m);
  const double speed = glm::length(camera.velocity_mps);
  if (limits.max_jerk_mps3 > 0)
    follow(camera, limits);
  else if (speed > 1e-9)
    add(camera.pose.position_m + camera.velocity_mps * (braking_distance_m(speed, limits) / speed));
}

void StopPath::add(const glm::dvec3& corner_m) {
  if (count_ < kMostCorners) ++count_;
  corners_m_[count_ - 1] = corner_m;
}

// Integrates braking in continuous time, which is later than braking in steps.
void StopPath::follow(const CameraState& camera, const CameraLimits& limits) {
  glm::dvec3 p = camera.pose.position_m, v = camera.velocity_mps, a = camera.acceleration_mps2;
  const double jerk = limits.max_jerk_mps3;
  for (int i = 0; i < kMostPoints; ++i) {
    const double speed = glm::length(v);
    const glm::dvec3 ahead = speed > 1e-9 ? v / speed : glm::dvec3(0.0);
    const double forward = glm::dot(a, ahead);
    const double beside = glm::length(a - forward * ahead), fade_s = beside / jerk;
    const double stops = std::sqrt(2 * jerk * speed);  // a greater deceleration would turn the camera back
    const bool turns_back = -forward > stops + jerk * kPointS;
    if (beside * fade_s * fade_s < kStraightM && !turns_back) {
      if (speed > 1e-6) add(p + ahead * straight_stop_m(speed, forward, limits));
      break;
    }
    bends_ = true;
    if (i > 0 && i % kPointsPerCorner == 0) add(p);
    const double braking = std::min(limits.max_acceleration_mps2, stops);
    const glm::dvec3 change = -ahead * braking - a;
    const double size = glm::length(change), most = jerk * kPointS;
    const glm::dvec3 next = size > most ? a + change * (most / size) : -ahead * braking;
    p += v * kPointS + (2.0 * a + next) * (kPointS * kPointS / 6);
    v += (a + next) * (kPointS / 2);
    a = next;
  }
  if (bends_) add(p);
}

}  // namespace sightline
