// The figures of a run (design 9): how much the camera saw, what it touched, and how it moved.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "client/truth/judge.h"
#include "client/truth/motion.h"
#include "server/settings/camera_limits.h"

namespace sightline {

struct TargetMetrics {
  uint64_t id = 0;
  std::string name;
  double mean_visible_share = 0.0;  // over pictures; a picture without the target counts as 0
  double mean_whole_share = 0.0;    // of its whole body, hidden and cut off counted alike (truth.h)
  double in_frame_share = 0.0;      // share of pictures that hold the target's centre
  size_t pictures = 0;              // taken while it was a target
};

// Loss of sight. An episode is a maximal run of judged pictures in which no pixel of one target is visible, whether it
// is off screen or hidden. Episodes of different targets count separately. An episode lasts from its first picture to
// the next one with a visible pixel. The target is reacquired in the first picture that shows 95 % of it. When no such
// picture follows, the last one counts.
struct EpisodeMetrics {
  size_t count = 0;
  double p95_length_s = 0.0;
  double mean_reacquire_s = 0.0;  // from the first picture of an episode
  size_t never_reacquired = 0;
};

// Shares are of the judged pictures, in [0, 1]; all are 0 when no picture was taken.
struct RunMetrics {
  size_t frames = 0, pictures = 0;
  std::vector<TargetMetrics> targets;
  double mean_visible_share = 0.0;  // mean over targets
  double mean_hidden_share = 0.0;   // of a target's pixels, over the targets that have any in a picture
  double in_frame_share = 0.0;      // mean over targets
  double r_n = 0.0;                 // no pixel of any target is visible
  double r_p = 0.0;                 // not r_n, and some target has a hidden pixel or is off screen
  double r_p_tolerant = 0.0;        // r_p with 5 % tolerance
  double all_seen = 0.0;            // every target has a visible pixel
  // every target is shown whole: at least 95 % of it unhidden, and 95 % of its outline in the picture
  double joint_whole_share = 0.0;
  double mean_whole_share = 0.0;  // mean over targets
  // The 95th percentile over pictures of the height of the target that is largest in it, in picture heights. From 1 on
  // it does not fit.
  double p95_size_pictures = 0.0;
  // The part of every target inside the picture is visible to at least 95 %: 1 - r_n - r_p_tolerant, exact to the
  // picture.
  double joint_visible_share() const;
  size_t body_collisions = 0;  // frames in which the body touches or has passed a collider
  double least_clearance_m = 0.0;
  size_t limit_violations = 0;  // frames that break at least one of the four motion limits
  EpisodeMetrics episodes;
  // The longest time without a target in sight, in seconds. It runs from a judged picture without a pixel of any target
  // to the next picture with one, or to the last picture. 0 when every picture holds a pixel. Its resolution is the
  // time between judged pictures.
  double longest_blind_s = 0.0;
  double d_c_m = 0.0;  // length of the camera's path (paper, section 6)
  // Length of the path of the targets' projected centres in the picture, summed over targets, in picture heights
  // (paper, section 6). Only pairs of neighbouring frames that both hold the centre count.
  double d_s_heights = 0.0;
  double peak_speed_mps = 0.0, peak_acceleration_mps2 = 0.0;
  double peak_angular_speed_radps = 0.0, peak_angular_acceleration_radps2 = 0.0;
  double rms_acceleration_mps2 = 0.0;
  double rms_jerk_mps3 = 0.0, p99_jerk_mps3 = 0.0, peak_jerk_mps3 = 0.0;  // p99: 99th percentile over frames
  // Shares of the frames with a valid MotionSample at which the camera uses at least kAtLimit of the limit, in [0, 1].
  double acceleration_limit_share = 0.0, speed_limit_share = 0.0;
  double reversals_per_s = 0.0;  // direction_reversals (motion.h) per second of the run
};

// Every figure of a run but those of single targets: the keys of to_json and columns of `sightline evaluate`.
struct RunFigure {
  std::string_view name;
  double (*of)(const RunMetrics& run);
};
std::span<const RunFigure> run_figures();

// The visibility of a target in one picture.
struct SightSample {
  double time_s = 0.0;
  double visible_share = 0.0;
};
// `targets`: for each target its samples in the order of time.
EpisodeMetrics episodes_of(std::span<const std::vector<SightSample>> targets);

// The figures of a scenario's run. `truths` is as long as `frames`.
RunMetrics summarize(const Scenario& scenario, std::span<const CameraFrame> frames, std::span<const FrameTruth> truths,
                     const CameraLimits& limits);

// The figures of any run. `targets`: the id and name of everything that was a target at some time; each picture says
// which of them were targets then. `truths` is as long as `frames`, or empty.
RunMetrics summarize(std::vector<TargetMetrics> targets, std::span<const CameraFrame> frames,
                     std::span<const FrameTruth> truths, const CameraLimits& limits);

// One JSON object: run_figures() by name, and `targets`.
std::string to_json(const RunMetrics& metrics);

// The least of `values` that a share `p` in [0, 1] of them does not exceed (nearest rank); 0 without values.
double percentile(std::vector<double> values, double p);

}  // namespace sightline
