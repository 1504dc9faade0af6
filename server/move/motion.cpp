#include "server/move/motion.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>

#include "server/base/check.h"

namespace sightline {
namespace {

constexpr double kPi = std::numbers::pi;

double wrap_angle(double rad) {
  return std::remainder(rad, 2 * kPi);
}

// The greatest speed from which one more step and then braking at `a` stays within `distance`: the root of
// v dt + v^2 / (2 a) = distance.
double approach_speed(double distance, double a, double dt_s) {
  return -a * dt_s + std::sqrt(a * a * dt_s * dt_s + 2 * a * distance);
}

template <typename Vec>
Vec limit_length(const Vec& v, double most) {
  const double length = glm::length(v);
  return length > most ? v * (most / length) : v;
}

// A rate over its maximum brakes straight, as far as its change is allowed; less than this share over it is rounding.
constexpr double kOverMaximum = 1 + 1e-9;

// `wanted` brought to within `most`, and then to within `most_change` of `present`. With present within `most` too the segment
// between both is, so that the two limits do not fight.
template <typename Vec>
Vec limit_rate(const Vec& present, const Vec& wanted, double most, double most_change) {
  const double rate = glm::length(present);
  if (rate > most * kOverMaximum) return present * (std::max(most, rate - most_change) / rate);
  return present + limit_length(limit_length(wanted, most) - present, most_change);
}

double roll_after(double roll_rad, double most) {
  return roll_rad - std::clamp(roll_rad, -most, most);
}

}  // namespace

Status validate(const CameraLimits& limits, const Lens& lens) {
  if (auto ok = validate(limits); !ok) return ok;
  if (const double corner = near_corner_distance_m(lens); corner > limits.body_radius_m) {
    char text[160];
    std::snprintf(text, sizeof text,
                  "must contain the near plane's corners, which are %g m from the lens, got %g", corner,
                  limits.body_radius_m);
    return invalid("body_radius_m", text);
  }
  return {};
}

glm::dvec3 clamp_velocity(const glm::dvec3& present, const glm::dvec3& wanted, const CameraLimits& limits,
                          double dt_s) {
  return limit_rate(present, wanted, limits.max_speed_mps, limits.max_acceleration_mps2 * dt_s);
}

glm::dvec3 velocity_towards(const CameraState& camera, const glm::dvec3& goal_m,
                            const glm::dvec3& goal_velocity_mps, const CameraLimits& limits, double dt_s) {
  const glm::dvec3 error = goal_m - camera.pose.position_m;
  const double distance = glm::length(error);
  glm::dvec3 wanted = goal_velocity_mps;
  if (distance > 1e-9) {
    const double speed = approach_speed(distance, kBrakeShare * limits.max_acceleration_mps2, dt_s);
    wanted += error * (speed / distance);
  }
  return clamp_velocity(camera.velocity_mps, wanted, limits, dt_s);
}

double braking_distance_m(const glm::dvec3& velocity_mps, const CameraLimits& limits) {
  return glm::dot(velocity_mps, velocity_mps) / (2 * limits.max_acceleration_mps2);
}

ViewAngles angles_from_rotation(const glm::dquat& world_from_camera, double yaw_when_vertical_rad) {
  const glm::dvec3 forward = world_from_camera * glm::dvec3(0, 0, -1);
  ViewAngles angles;
  angles.pitch_rad = std::asin(std::clamp(forward.y, -1.0, 1.0));
  const bool vertical = std::hypot(forward.x, forward.z) < 1e-6;
  angles.yaw_rad = vertical ? yaw_when_vertical_rad : std::atan2(-forward.x, -forward.z);
  const glm::dquat level = rotation_from_angles({angles.yaw_rad, angles.pitch_rad, 0.0});
  const glm::dvec3 right = glm::conjugate(level) * (world_from_camera * glm::dvec3(1, 0, 0));
  angles.roll_rad = std::atan2(right.y, right.x);
  return angles;
}

glm::dquat rotation_from_angles(const ViewAngles& a) {
  const glm::dquat yaw = glm::angleAxis(a.yaw_rad, glm::dvec3(0, 1, 0));
  const glm::dquat pitch = glm::angleAxis(a.pitch_rad, glm::dvec3(1, 0, 0));
  return glm::normalize(yaw * pitch * glm::angleAxis(a.roll_rad, glm::dvec3(0, 0, 1)));
}

TurnState turn_towards(const TurnState& state, const ViewAngles& aim, const CameraLimits& limits,
                       double response_s, double dt_s) {
  if (dt_s <= 0) return state;
  const glm::dvec2 present(state.yaw_rate_radps, state.pitch_rate_radps);
  const glm::dvec2 error(wrap_angle(aim.yaw_rad - state.angles.yaw_rad),
                         aim.pitch_rad - state.angles.pitch_rad);
  const double size = glm::length(error);
  glm::dvec2 wanted(0.0);
  if (size > 1e-12) {
    double rate = approach_speed(size, kBrakeShare * limits.max_angular_acceleration_radps2, dt_s);
    if (response_s > 0) rate = std::min(rate, size * (1 - std::pow(0.01, dt_s / response_s)) / dt_s);
    wanted = error * (rate / size);
  }
  const glm::dvec2 rates = limit_rate(present, wanted, limits.max_angular_speed_radps,
                                      limits.max_angular_acceleration_radps2 * dt_s);
  TurnState next;
  next.yaw_rate_radps = rates.x;
  next.pitch_rate_radps = rates.y;
  next.angles.yaw_rad = wrap_angle(state.angles.yaw_rad + rates.x * dt_s);
  next.angles.pitch_rad = state.angles.pitch_rad + rates.y * dt_s;
  next.angles.roll_rad = roll_after(state.angles.roll_rad, limits.max_angular_speed_radps * dt_s);
  return next;
}

}  // namespace sightline
