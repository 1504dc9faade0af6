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

// The limit of the jerk delays braking by this time on average, seconds.
double onset_s(const CameraLimits& limits) {
  return limits.max_jerk_mps3 > 0 ? limits.max_acceleration_mps2 / (2 * limits.max_jerk_mps3) : 0.0;
}

template <typename Vec>
Vec limit_length(const Vec& v, double most) {
  const double length = glm::length(v);
  return length > most ? v * (most / length) : v;
}

// A rate above its maximum by less than this factor is a rounding error.
constexpr double kOverMaximum = 1 + 1e-9;

// `wanted`, clamped to `most`, and then to within `most_change` of `present`. If `present` is within `most`, so is the
// segment between the two, and the limits do not conflict. Otherwise the rate brakes straight.
template <typename Vec>
Vec limit_rate(const Vec& present, const Vec& wanted, double most, double most_change) {
  const double rate = glm::length(present);
  if (rate > most * kOverMaximum) return present * (std::max(most, rate - most_change) / rate);
  return present + limit_length(limit_length(wanted, most) - present, most_change);
}

// Lowers a pitch rate from which the camera could not stop before straight up or down, braking with all of the
// acceleration `a`. The rate that it returns keeps v^2 / (2 a) <= the angle left, so the next step can brake in time as
// well, however long it is.
glm::dvec2 brake_before_pole(const glm::dvec2& present, const glm::dvec2& rates, double pitch_rad, double a,
                             double dt_s) {
  const double up = rates.y < 0 ? -1 : 1;
  const double left_rad = std::max(0.0, kMaxPitchRad - up * pitch_rad);
  const double most = std::max(approach_speed(left_rad, a, dt_s), up * present.y - a * dt_s);
  if (up * rates.y <= most) return rates;
  const double pitch_rate = up * std::min(most, left_rad / dt_s);
  const double change = a * dt_s, spent = std::min(std::abs(pitch_rate - present.y), change);
  const double yaw_change = std::sqrt(change * change - spent * spent);
  return {present.x + std::clamp(rates.x - present.x, -yaw_change, yaw_change), pitch_rate};
}

// The velocity at which the camera arrives if its acceleration fades as fast as the limit of the jerk allows.
glm::dvec3 settled_velocity(const glm::dvec3& velocity, const glm::dvec3& acceleration, double jerk) {
  return velocity + acceleration * (glm::length(acceleration) / (2 * jerk));
}

// The acceleration that brings the velocity to `wanted` soonest, so that it can fade in time.
glm::dvec3 fading_acceleration(const glm::dvec3& present, const glm::dvec3& wanted, const CameraLimits& limits,
                               double dt_s, double response_s) {
  const glm::dvec3 change = wanted - present;
  const double size = glm::length(change);
  if (size < 1e-12) return glm::dvec3(0.0);
  const double fading = approach_speed(size, limits.max_jerk_mps3, dt_s);
  return change * (std::min({fading, size / std::max(response_s, dt_s), limits.max_acceleration_mps2}) / size);
}

// Between the fading of the present acceleration, after which the speed is within its limit, and `wanted`.
glm::dvec3 within_speed(const CameraState& camera, const glm::dvec3& wanted, const CameraLimits& limits, double dt_s) {
  const double jerk = limits.max_jerk_mps3, most = limits.max_speed_mps * kOverMaximum;
  const auto obeys = [&](const glm::dvec3& a) {
    const glm::dvec3 velocity = camera.velocity_mps + a * dt_s;
    return glm::length(velocity) <= most && glm::length(settled_velocity(velocity, a, jerk)) <= most;
  };
  if (obeys(wanted)) return wanted;
  const double size = glm::length(camera.acceleration_mps2);
  const glm::dvec3 fading = size > jerk * dt_s ? camera.acceleration_mps2 * (1 - jerk * dt_s / size) : glm::dvec3(0.0);
  double low = 0, high = 1;
  for (int i = 0; i < 20; ++i) {
    const double middle = (low + high) / 2;
    (obeys(fading + middle * (wanted - fading)) ? low : high) = middle;
  }
  return fading + low * (wanted - fading);
}

// The rate at which the camera rolls towards the aim: at most `most_radps`, braking in time, and changed by at most `a`
// dt.
double roll_rate_after(const TurnState& state, double aim_rad, double most_radps, double a, double response_s,
                       double dt_s) {
  const double error = wrap_angle(aim_rad - state.angles.roll_rad), size = std::abs(error);
  double wanted = std::min(approach_speed(size, kBrakeShare * a, dt_s), most_radps);
  if (response_s > 0) wanted = std::min(wanted, size * (1 - std::pow(0.01, dt_s / response_s)) / dt_s);
  return std::clamp(error < 0 ? -wanted : wanted, state.roll_rate_radps - a * dt_s, state.roll_rate_radps + a * dt_s);
}

}  // namespace

Status validate(const CameraLimits& limits, const Lens& lens) {
  if (auto ok = validate(limits); !ok) return ok;
  if (const double corner = near_corner_distance_m(lens); corner > limits.body_radius_m) {
    char text[160];
    std::snprintf(text, sizeof text, "must contain the near plane's corners, which are %g m from the lens, got %g",
                  corner, limits.body_radius_m);
    return invalid("body_radius_m", text);
  }
  return {};
}

glm::dvec3 clamp_velocity(const glm::dvec3& present, const glm::dvec3& wanted, const CameraLimits& limits,
                          double dt_s) {
  return limit_rate(present, wanted, limits.max_speed_mps, limits.max_acceleration_mps2 * dt_s);
}

glm::dvec3 steer_velocity(const CameraState& camera, const glm::dvec3& wanted_mps, const CameraLimits& limits,
                          double response_s, double dt_s) {
  const glm::dvec3& present = camera.velocity_mps;
  const double jerk = limits.max_jerk_mps3, share = response_s > dt_s ? dt_s / response_s : 1.0;
  if (jerk <= 0 || dt_s <= 0 || glm::length(present) > limits.max_speed_mps * kOverMaximum)
    return clamp_velocity(present, present + share * (wanted_mps - present), limits, dt_s);
  const glm::dvec3 wanted = fading_acceleration(present, limit_length(wanted_mps, limits.max_speed_mps), limits, dt_s,
                                                response_s);
  const glm::dvec3 limited = limit_rate(camera.acceleration_mps2, wanted, limits.max_acceleration_mps2, jerk * dt_s);
  // The last clamp matters only after a step that the limit of the jerk did not hold for.
  return clamp_velocity(present, present + within_speed(camera, limited, limits, dt_s) * dt_s, limits, dt_s);
}

CameraState moved(const CameraState& camera, const glm::dvec3& velocity_mps, double dt_s) {
  CameraState next = camera;
  next.acceleration_mps2 = (velocity_mps - camera.velocity_mps) / dt_s;
  next.velocity_mps = velocity_mps;
  next.pose.position_m += velocity_mps * dt_s;
  return next;
}

glm::dvec3 velocity_towards(const CameraState& camera, const glm::dvec3& goal_m, const glm::dvec3& goal_velocity_mps,
                            const CameraLimits& limits, double dt_s) {
  const glm::dvec3 error = goal_m - camera.pose.position_m;
  const double distance = glm::length(error);
  glm::dvec3 wanted = goal_velocity_mps;
  if (distance > 1e-9) {
    wanted += error * (arrival_speed_mps(distance, limits, dt_s) / distance);
  }
  return steer_velocity(camera, wanted, limits, 0.0, dt_s);
}

double braking_distance_m(const glm::dvec3& velocity_mps, const CameraLimits& limits) {
  return glm::dot(velocity_mps, velocity_mps) / (2 * limits.max_acceleration_mps2);
}

double arrival_speed_mps(double distance_m, const CameraLimits& limits, double dt_s) {
  return approach_speed(distance_m, kBrakeShare * limits.max_acceleration_mps2, dt_s + onset_s(limits));
}

ViewAngles angles_from_rotation(const glm::dquat& world_from_camera) {
  const glm::dvec3 forward = world_from_camera * glm::dvec3(0, 0, -1);
  const glm::dvec3 side = world_from_camera * glm::dvec3(1, 0, 0);
  ViewAngles angles;
  angles.pitch_rad = std::asin(std::clamp(forward.y, -1.0, 1.0));
  const bool vertical = std::hypot(forward.x, forward.z) < 1e-6;
  angles.yaw_rad = vertical ? std::atan2(-side.z, side.x) : std::atan2(-forward.x, -forward.z);
  const glm::dquat level = rotation_from_angles({angles.yaw_rad, angles.pitch_rad, 0.0});
  const glm::dvec3 right = glm::conjugate(level) * side;
  angles.roll_rad = std::atan2(right.y, right.x);
  return angles;
}

glm::dquat rotation_from_angles(const ViewAngles& a) {
  const glm::dquat yaw = glm::angleAxis(a.yaw_rad, glm::dvec3(0, 1, 0));
  const glm::dquat pitch = glm::angleAxis(a.pitch_rad, glm::dvec3(1, 0, 0));
  return glm::normalize(yaw * pitch * glm::angleAxis(a.roll_rad, glm::dvec3(0, 0, 1)));
}

TurnState turn_towards(const TurnState& state, const ViewAngles& aim, const CameraLimits& limits, double response_s,
                       double dt_s) {
  if (dt_s <= 0) return state;
  const glm::dvec2 present(state.yaw_rate_radps, state.pitch_rate_radps);
  const glm::dvec2 error(wrap_angle(aim.yaw_rad - state.angles.yaw_rad), aim.pitch_rad - state.angles.pitch_rad);
  const double size = glm::length(error);
  glm::dvec2 wanted(0.0);
  if (size > 1e-12) {
    double rate = approach_speed(size, kBrakeShare * limits.max_angular_acceleration_radps2, dt_s);
    if (response_s > 0) rate = std::min(rate, size * (1 - std::pow(0.01, dt_s / response_s)) / dt_s);
    wanted = error * (rate / size);
  }
  const glm::dvec2 limited = limit_rate(present, wanted, limits.max_angular_speed_radps,
                                        limits.max_angular_acceleration_radps2 * dt_s);
  const glm::dvec2 rates = brake_before_pole(present, limited, state.angles.pitch_rad,
                                             limits.max_angular_acceleration_radps2, dt_s);
  TurnState next;
  next.yaw_rate_radps = rates.x;
  next.pitch_rate_radps = rates.y;
  next.angles.yaw_rad = wrap_angle(state.angles.yaw_rad + rates.x * dt_s);
  next.angles.pitch_rad = state.angles.pitch_rad + rates.y * dt_s;
  const double left_radps = std::max(0.0, limits.max_angular_speed_radps - glm::length(rates));
  next.roll_rate_radps = roll_rate_after(state, aim.roll_rad, left_radps, limits.max_angular_acceleration_radps2,
                                         response_s, dt_s);
  next.angles.roll_rad = wrap_angle(state.angles.roll_rad + next.roll_rate_radps * dt_s);
  constexpr double kLevelRad = 1e-9;
  const bool arrives = std::abs(wrap_angle(aim.roll_rad - state.angles.roll_rad)) < kLevelRad &&
                       std::abs(state.roll_rate_radps) * dt_s < kLevelRad;
  if (arrives) next.angles.roll_rad = aim.roll_rad, next.roll_rate_radps = 0.0;
  return next;
}

}  // namespace sightline
