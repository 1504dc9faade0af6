// Motion: from the goal to the next pose, never beyond the limits (design 6).
//
// A step from time t to t + dt moves the camera by v' dt, v' being the velocity that it then has: between two poses the
// path is straight and at constant speed. So |v'| <= max_speed and |v' - v| <= max_acceleration * dt hold exactly for
// finite differences of the returned poses, whatever dt does.
#pragma once

#include <glm/glm.hpp>

#include "server/base/camera.h"
#include "server/base/error.h"
#include "server/settings/camera_limits.h"

namespace sightline {

// The ranges of the limits, and that the body contains the corners of the near plane.
Status validate(const CameraLimits& limits, const Lens& lens);

// Longest step that the camera moves for; a longer gap moves it for this long.
inline constexpr double kMaxStepS = 0.25;

// Braking is planned with this share of the allowed acceleration, so that a goal that moves can still be met.
inline constexpr double kBrakeShare = 0.7;

// The velocity that brings the camera to `goal_m` soonest and lets it arrive with `goal_velocity_mps` without overshoot:
// the braking curve v = sqrt(2 a d), clamped to the limits as seen from the present velocity.
glm::dvec3 velocity_towards(const CameraState& camera, const glm::dvec3& goal_m,
                            const glm::dvec3& goal_velocity_mps, const CameraLimits& limits, double dt_s);

// `wanted` brought into the balls |v'| <= v_max and |v' - v| <= a dt. When the present speed is over the maximum (limits were
// lowered) it brakes straight ahead, as fast as the acceleration allows, until it is not: |v'| <= max(v_max, |v| - a dt).
glm::dvec3 clamp_velocity(const glm::dvec3& present, const glm::dvec3& wanted, const CameraLimits& limits,
                          double dt_s);

// Path length in which the camera can stop from velocity v: |v|^2 / (2 a). The discrete brake stays within it.
double braking_distance_m(const glm::dvec3& velocity_mps, const CameraLimits& limits);

// Yaw about +Y (0 looks along -Z, positive turns left), pitch above the horizontal, roll about the view axis. A camera
// without roll turns by yaw rate about +Y and pitch rate about its right-hand side, which are orthogonal, so its angular speed
// is the length of (yaw rate, pitch rate) even straight up or down.
struct ViewAngles {
  double yaw_rad = 0, pitch_rad = 0, roll_rad = 0;
};
ViewAngles angles_from_rotation(const glm::dquat& world_from_camera, double yaw_when_vertical_rad);
glm::dquat rotation_from_angles(const ViewAngles& angles);

struct TurnState {
  ViewAngles angles;
  double yaw_rate_radps = 0, pitch_rate_radps = 0;
};

// Turns towards the aim, (yaw rate, pitch rate) within max_angular_speed and its change within max_angular_acceleration * dt;
// a rate over the maximum brakes as in clamp_velocity.
// `response_s`: time to close 99 % of an error where the limits allow; 0 = as fast as they allow. Any roll is let go at no
// more than max_angular_speed.
TurnState turn_towards(const TurnState& state, const ViewAngles& aim, const CameraLimits& limits,
                       double response_s, double dt_s);

}  // namespace sightline
