// How a camera moved between the frames of its path, by finite differences of its poses.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "client/truth/judge.h"
#include "server/settings/camera_limits.h"

namespace sightline {

// How a camera moved between two frames.
struct MotionSample {
  double speed_mps = 0.0, acceleration_mps2 = 0.0;
  double angular_speed_radps = 0.0;
  double angular_acceleration_radps2 = 0.0;  // change of (yaw rate, pitch rate)
  bool valid = false;                        // false for the first frame, a jump, or when no time has passed
  double jerk_mps3 = 0.0;                    // change of acceleration
  bool has_jerk = false;                     // this frame and the one before are valid
};
// One sample a frame. The camera is taken to be at rest before the first.
std::vector<MotionSample> motion_of(std::span<const CameraFrame> frames);

// True when `sample` breaks a limit by more than rounding explains: 1e-6 of the limit for positions, and 1e-4 for
// angles. Second differences of angles over a short step cancel most of a double's digits.
bool breaks_limits(const MotionSample& sample, const CameraLimits& limits);

// A frame is at a limit when it uses at least this share of it.
inline constexpr double kAtLimit = 0.99;

// The number of times that the camera turns back. At a reversal, the velocity is at more than 90 degrees to the
// velocity of some frame at most kReversalWindowS before. Both are at least kReversalSpeedMps fast. Velocities are of
// the world and over one frame. The frames before a reversal, and those before a jump, are not compared with later
// ones, so each turn counts once. A camera that rests for longer than the window between two motions does not reverse.
inline constexpr double kReversalWindowS = 0.5;
inline constexpr double kReversalSpeedMps = 0.2;
size_t direction_reversals(std::span<const CameraFrame> frames);

// The position that a camera heads for at one frame.
struct GoalSample {
  double time_s = 0.0;
  std::optional<glm::dvec3> goal_m;  // world; none when it heads for nothing
  glm::dvec3 targets_center_m{0.0};  // world; the targets' weighted centre
  bool jump = false;                 // as in CameraFrame
};
// Changes of mind. The goal jumps at a frame when it is more than kGoalJumpM away from where it was at a frame at most
// kGoalJumpS before, or at the frame before if that is longer ago; the motion of the targets' centre is taken off.
// Frames before a jump are not compared with later ones, so each change counts once, whether it came in one tick or in
// two. Only frames that have a goal count, and none are compared across a declared jump of the camera.
inline constexpr double kGoalJumpM = 0.5;
inline constexpr double kGoalJumpS = 1.0 / 30;
struct GoalMetrics {
  size_t jumps = 0;
  double watched_s = 0.0;    // between neighbouring frames that were compared
  double jumps_per_s = 0.0;  // jumps / watched_s; 0 when no time was watched
};
GoalMetrics goals_of(std::span<const GoalSample> samples);

}  // namespace sightline
