// A run in figures (design 9): how much was seen, what was touched, how the camera moved.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "client/judge.h"
#include "server/base/camera.h"

namespace sightline {

struct TargetMetrics {
  uint64_t id = 0;
  std::string name;
  double mean_visible_share = 0.0;  // over pictures; 0 where it is off screen
  double in_frame_share = 0.0;      // of pictures in which its centre is inside
};

// Shares are of the judged pictures, in [0, 1]. All are 0 when no picture was taken.
struct RunMetrics {
  size_t frames = 0, pictures = 0;
  std::vector<TargetMetrics> targets;
  double mean_visible_share = 0.0;  // over targets
  double r_n = 0.0;                 // no pixel of any target visible
  double r_p = 0.0;                 // not that, and some target pixel hidden or some target off screen
  double r_p_tolerant = 0.0;        // the same with 5 % tolerance
  double all_seen = 0.0;            // every target has a visible pixel
  // Every target visible to 95 % at least: 1 - r_n - r_p_tolerant.
  double all_clear() const { return pictures == 0 ? 0.0 : 1.0 - r_n - r_p_tolerant; }
  size_t body_collisions = 0;  // frames in which the body touches or has passed a collider
  double least_clearance_m = 0.0;
  size_t limit_violations = 0;  // frames that break at least one of the four limits
  double d_c_m = 0.0;           // length of the camera's path (paper, section 5)
  double peak_speed_mps = 0.0, peak_acceleration_mps2 = 0.0;
  double peak_angular_speed_radps = 0.0, peak_angular_acceleration_radps2 = 0.0;
};

// How a camera moved between frames, by finite differences of its poses alone.
struct MotionSample {
  double speed_mps = 0.0, acceleration_mps2 = 0.0;
  double angular_speed_radps = 0.0;
  double angular_acceleration_radps2 = 0.0;  // change of (yaw rate, pitch rate)
  bool valid = false;                        // false: the first frame, a jump, or no time has passed
};
// One for each frame. The camera is at rest before the first.
std::vector<MotionSample> motion_of(std::span<const CameraFrame> frames);

// True when `sample` breaks a limit by more than what rounding explains: 1e-6 of the limit for positions;
// 1e-4 for angles, whose second differences over a short step cancel most of a double's digits.
bool breaks_limits(const MotionSample& sample, const CameraLimits& limits);

// `truths` as long as `frames`.
RunMetrics summarize(const Scenario& scenario, std::span<const CameraFrame> frames,
                     std::span<const FrameTruth> truths, const CameraLimits& limits);

// One JSON object, keys as the fields above.
std::string to_json(const RunMetrics& metrics);

// The value below which a share `p` in [0, 1] of `values` lies (nearest rank); 0 when there is none.
double percentile(std::vector<double> values, double p);

}  // namespace sightline
