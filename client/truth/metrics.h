// A run in figures (design 9): how much was seen, what was touched, how the camera moved.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "client/truth/judge.h"
#include "server/base/camera.h"

namespace sightline {

struct TargetMetrics {
  uint64_t id = 0;
  std::string name;
  double mean_visible_share = 0.0;  // over pictures; 0 where it is off screen
  double in_frame_share = 0.0;      // of pictures in which its centre is inside
  size_t pictures = 0;              // while it was a target
};

// Losing sight. An episode is a longest row of judged pictures in which no pixel of one target is visible,
// off screen or hidden; episodes of different targets count apart. It lasts from its first picture to the
// first with a visible pixel, or to the last picture judged. Reacquiring takes from its first picture to the
// first in which 95 % of the target are visible; when none follows, to the last picture judged.
struct EpisodeMetrics {
  size_t count = 0;
  double p95_length_s = 0.0;
  double mean_reacquire_s = 0.0;
  size_t never_reacquired = 0;
};

// Shares are of the judged pictures, in [0, 1]. All are 0 when no picture was taken.
struct RunMetrics {
  size_t frames = 0, pictures = 0;
  std::vector<TargetMetrics> targets;
  double mean_visible_share = 0.0;  // over targets
  double mean_hidden_share = 0.0;   // of a target's pixels, over the targets that have any in a picture
  double in_frame_share = 0.0;      // over targets
  double r_n = 0.0;                 // no pixel of any target visible
  double r_p = 0.0;                 // not that, and some target pixel hidden or some target off screen
  double r_p_tolerant = 0.0;        // the same with 5 % tolerance
  double all_seen = 0.0;            // every target has a visible pixel
  // The joint visible share: every target visible to 95 % at least: 1 - r_n - r_p_tolerant, to the picture.
  double joint_visible_share() const;
  size_t body_collisions = 0;  // frames in which the body touches or has passed a collider
  double least_clearance_m = 0.0;
  size_t limit_violations = 0;  // frames that break at least one of the four limits
  EpisodeMetrics episodes;
  double d_c_m = 0.0;  // length of the camera's path (paper, section 6)
  // Length of the way of the targets' projected centres in the picture, summed over targets, in picture
  // heights (paper, section 6). Counted between frames in both of which the centre is in the picture.
  double d_s_heights = 0.0;
  // Frames whose pose is more than 0.5 m or 5 degrees from the one before without a declared jump.
  size_t pops = 0;
  double peak_speed_mps = 0.0, peak_acceleration_mps2 = 0.0;
  double peak_angular_speed_radps = 0.0, peak_angular_acceleration_radps2 = 0.0;
  double rms_acceleration_mps2 = 0.0, rms_jerk_mps3 = 0.0, peak_jerk_mps3 = 0.0;
};

inline constexpr double kPopM = 0.5;
inline constexpr double kPopRad = 0.08726646259971647;  // 5 degrees

// How a camera moved between frames, by finite differences of its poses alone.
struct MotionSample {
  double speed_mps = 0.0, acceleration_mps2 = 0.0;
  double angular_speed_radps = 0.0;
  double angular_acceleration_radps2 = 0.0;  // change of (yaw rate, pitch rate)
  bool valid = false;                        // false: the first frame, a jump, or no time has passed
  double jerk_mps3 = 0.0;                    // change of acceleration
  bool has_jerk = false;                     // as `valid`, for this frame and the one before
};
// One for each frame. The camera is at rest before the first.
std::vector<MotionSample> motion_of(std::span<const CameraFrame> frames);

// True when `sample` breaks a limit by more than what rounding explains: 1e-6 of the limit for positions;
// 1e-4 for angles, whose second differences over a short step cancel most of a double's digits.
bool breaks_limits(const MotionSample& sample, const CameraLimits& limits);

// What one target's pictures showed, in the order of time.
struct SightSample {
  double time_s = 0.0;
  double visible_share = 0.0;
};
// One row of samples a target.
EpisodeMetrics episodes_of(std::span<const std::vector<SightSample>> targets);

// What a policy says of one target at one frame.
struct ReportedShare {
  uint64_t id = 0;
  double visible_share = 0.0;   // of this step, as reported, [0, 1]
  double filtered_share = 0.0;  // of the last steps, as reported, [0, 1]
};
// Of one of the reported shares.
struct ReportErrors {
  double false_visible = 0.0;        // of the hidden pairs, those said to be visible
  double false_occluded = 0.0;       // of the visible pairs, those said not to be
  double mean_absolute_error = 0.0;  // of the share, over all pairs
};
// The service's own word against the truth, over judged pictures and those targets of which the picture holds
// a pixel. Visible means a share of at least one half, said or true.
struct ReportMetrics {
  size_t pairs = 0, hidden_pairs = 0;  // (picture, target): all; truly not visible
  ReportErrors visible, filtered;        // of visible_share, of filtered_share
};
// `words` as long as `truths`, matched by id; a target without a word is left out.
ReportMetrics judge_reports(std::span<const FrameTruth> truths, std::span<const std::vector<ReportedShare>> words);

// `truths` as long as `frames`.
RunMetrics summarize(const Scenario& scenario, std::span<const CameraFrame> frames,
                     std::span<const FrameTruth> truths, const CameraLimits& limits);

// The same of any session, `truths` as long as `frames` or empty: `targets` are all that were targets at any time, by id and name; the pictures say which of them
// were at theirs.
RunMetrics summarize(std::vector<TargetMetrics> targets, std::span<const CameraFrame> frames,
                     std::span<const FrameTruth> truths, const CameraLimits& limits);

// One JSON object, keys as the fields above.
std::string to_json(const RunMetrics& metrics);

// The value below which a share `p` in [0, 1] of `values` lies (nearest rank); 0 when there is none.
double percentile(std::vector<double> values, double p);

}  // namespace sightline
