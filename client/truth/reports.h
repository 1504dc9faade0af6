// Compares a policy's reports about its view with what the camera truly sees.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "client/truth/judge.h"

namespace sightline {

// The visible shares that a policy reports for one target at one frame.
struct ReportedShare {
  uint64_t id = 0;
  double visible_share = 0.0;   // in this step, [0, 1]
  double filtered_share = 0.0;  // over the last steps, [0, 1]
};
// How wrong one of the two reported shares is.
struct ReportErrors {
  double false_visible = 0.0;        // share of the hidden pairs that were reported visible
  double false_occluded = 0.0;       // share of the visible pairs that were reported hidden
  double mean_absolute_error = 0.0;  // of the share, over all pairs
};
// A policy's reports against the truth. A pair is a judged picture and a target with at least one pixel in it. A target
// is visible at a share of at least one half, both as reported and in truth.
struct ReportMetrics {
  size_t pairs = 0, hidden_pairs = 0;  // all pairs; pairs whose target is truly not visible
  ReportErrors visible, filtered;      // of visible_share and of filtered_share
};
// `reports`: one list a frame, as long as `truths`. Targets are matched by id; one that was not reported is left out.
ReportMetrics judge_reports(std::span<const FrameTruth> truths, std::span<const std::vector<ReportedShare>> reports);

// A policy's status against the truth, over the judged pictures at whose frames it reported a status. All shares are in
// [0, 1], and 0 when nothing was there to be counted.
struct StatusMetrics {
  size_t pictures = 0;  // with a status
  // share of these pictures: the status was TRACKING and no pixel of any target visible
  double tracking_while_lost = 0.0;
  // share of the pictures without a visible pixel of any target whose status was TRACKING
  double lost_called_tracking = 0.0;
  // Share of these pictures: the status was TRACKING, and some required target was visible to less than one half. A
  // target outside the picture is not visible.
  double tracking_while_half_hidden = 0.0;
};
// `tracking`: by frame, whether the status was TRACKING; none where no status was reported. As long as `truths`.
// `required_ids`: the targets that TRACKING promises to see.
StatusMetrics judge_status(std::span<const FrameTruth> truths, std::span<const std::optional<bool>> tracking,
                           std::span<const uint64_t> required_ids);

}  // namespace sightline
