// Moves and turns the camera towards its goal, never beyond the limits (design 6).
//
// A step from time t to t + dt moves the camera by v' dt, where v' is the velocity after the step. Between two poses
// the path is straight at constant speed. So |v'| <= max_speed and |v' - v| <= max_acceleration * dt hold exactly for
// finite differences of the returned poses, however dt varies. With a' = (v' - v) / dt, |a' - a| <= max_jerk * dt holds
// too, unless the body has to keep clear of geometry (body.h).
#pragma once

#include <glm/glm.hpp>

#include "server/base/camera.h"
#include "server/base/error.h"
#include "server/settings/camera_limits.h"

namespace sightline {

// The ranges of the limits, and that the body contains the corners of the near plane.
Status validate(const CameraLimits& limits, const Lens& lens);

// The longest time step that the camera moves for, seconds. After a longer gap it moves for this long only.
inline constexpr double kMaxStepS = 0.25;

// Share of the allowed acceleration with which braking is planned. The rest is a reserve for goals that move.
inline constexpr double kBrakeShare = 0.7;

// The velocity that brings the camera to `goal_m` soonest so that it arrives with `goal_velocity_mps` and does not
// overshoot. It follows the braking curve v = sqrt(2 a d), clamped to what the limits allow from the present velocity.
glm::dvec3 velocity_towards(const CameraState& camera, const glm::dvec3& goal_m, const glm::dvec3& goal_velocity_mps,
                            const CameraLimits& limits, double dt_s);

// `wanted`, clamped to |v'| <= v_max and |v' - v| <= a dt. Lowered limits can leave the present
// speed above the maximum. Then the camera brakes straight ahead as fast as it may: |v'| <= max(v_max, |v| - a dt).
glm::dvec3 clamp_velocity(const glm::dvec3& present, const glm::dvec3& wanted, const CameraLimits& limits, double dt_s);

// The velocity after a step that approaches `wanted_mps` with this time constant, or as fast as the limits of speed,
// acceleration and jerk allow (response_s = 0). The acceleration fades in time, so that the velocity settles at the
// wanted one without overshoot. While the speed is above a lowered maximum the camera brakes as above, without a limit
// of the jerk.
glm::dvec3 steer_velocity(const CameraState& camera, const glm::dvec3& wanted_mps, const CameraLimits& limits,
                          double response_s, double dt_s);

// The camera after a step of dt_s > 0 at this velocity. Its orientation stays.
CameraState moved(const CameraState& camera, const glm::dvec3& velocity_mps, double dt_s);

// Path length in which the camera can stop from velocity v, |v|^2 / (2 a), metres. Braking in discrete steps stays
// within it.
double braking_distance_m(const glm::dvec3& velocity_mps, const CameraLimits& limits);
// The greatest speed from which the camera stops within `distance_m` after one more step. It brakes with the share
// kBrakeShare of the acceleration, which sets in within the limit of the jerk.
double arrival_speed_mps(double distance_m, const CameraLimits& limits, double dt_s);

// Yaw about +Y (0 looks along -Z, positive turns left), pitch above the horizontal, roll about the view axis. A camera
// without roll turns by yaw rate about +Y and by pitch rate about its right-hand side. These axes are orthogonal, so
// its angular speed is the length of (yaw rate, pitch rate), even straight up or down.
struct ViewAngles {
  double yaw_rad = 0, pitch_rad = 0, roll_rad = 0;
};
// Looking straight up or down, the yaw is the one that leaves no roll.
ViewAngles angles_from_rotation(const glm::dquat& world_from_camera);
glm::dquat rotation_from_angles(const ViewAngles& angles);

// The steepest pitch that a turn aims at or reaches, up or down. The camera is then upright and its yaw is no noise.
inline constexpr double kMaxPitchRad = 1.5707963267948966 - 1e-3;

struct TurnState {
  ViewAngles angles;
  double yaw_rate_radps = 0, pitch_rate_radps = 0, roll_rate_radps = 0;
};

// Turns towards the aim. The vector (yaw rate, pitch rate) stays within max_angular_speed, and its change within
// max_angular_acceleration * dt; a rate over the maximum (limits were lowered) brakes as in clamp_velocity.
//
// The pitch never passes +-kMaxPitchRad, so the camera is never upside down. A camera that starts beyond it goes no
// further. It always brakes in time for the pole; the yaw gets the remaining acceleration. Only limits that are lowered
// during a turn can make that impossible. Then the acceleration limit yields to the pole, and the speed limit to the
// acceleration limit.
//
// `response_s`: time to close 99 % of an error where the limits allow, seconds; 0 = as fast as they allow. The camera
// rolls towards the aim with what is left of max_angular_speed. The rate of the roll changes within
// max_angular_acceleration, apart from the other two.
TurnState turn_towards(const TurnState& state, const ViewAngles& aim, const CameraLimits& limits, double response_s,
                       double dt_s);

}  // namespace sightline
