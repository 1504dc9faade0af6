// The result of a replay, compared with the recording.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <ostream>
#include <string>
#include <vector>

#include "client/replay/compare_replies.h"
#include "client/replay/replay.h"

namespace sightline {

// A camera that is so far from its recorded pose would be seen to jump.
inline constexpr double kVisibleJumpM = 0.5;
inline constexpr double kVisibleJumpRad = 0.08726646259971647;  // 5 degrees

// Replies that need not be equal are alike while the camera is nearer to its recorded pose than a visible jump.
// kNothing: the recording has no reply, so there is nothing to compare.
enum class ReplayVerdict { kEqual, kAlike, kDiffers, kNothing };

// The reason for changed settings: the result is then no verdict.
inline constexpr const char* kOtherSettings = "other settings";

// Not thread-safe.
class ReplayResult {
 public:
  // `never_equal`: why no reply need be equal ("another sampler"). Empty: all must be equal, up to the first gap.
  // `unknown`: as of ReplyComparison.
  ReplayResult(const Convention& convention, std::string never_equal, const IgnoredFields& unknown = {})
      : replies_(convention, unknown), never_equal_(std::move(never_equal)) {}

  void add(const ReplayedStep& step);
  // Replies need not be equal for this reason; the first reason counts.
  void excuse(const std::string& reason) {
    if (never_equal_.empty()) never_equal_ = reason;
  }

  const ReplyComparison& replies() const { return replies_; }
  ReplayVerdict verdict() const;
  // Prints lines like "replies 3600 compared, ...", the verdict last.
  void print(std::ostream& out) const;
  // The same as one object: `verdict` ("equal", "alike", "differs", "nothing", or "other settings"), `reason` (why
  // replies need not be equal, or ""), and the counts.
  nlohmann::ordered_json json() const;

 private:
  void add_rejections(const ReplayedStep& step);
  bool expected_equal() const;

  ReplyComparison replies_;
  std::string never_equal_;
  uint64_t only_recorded_ = 0, only_replayed_ = 0;  // replies
  uint64_t refused_both_ = 0, refused_only_replayed_ = 0;
  std::vector<uint64_t> refused_recorded_;  // sequences that the replay has not refused so far
  std::optional<v1::TickError> first_new_refusal_;
  uint64_t faults_ = 0, gaps_ = 0, missing_ = 0, lost_replies_ = 0, unanswered_ticks_ = 0;
  std::string first_fault_;
  uint64_t compared_before_gap_ = 0, equal_before_gap_ = 0;
};

const char* to_string(ReplayVerdict verdict);

}  // namespace sightline
