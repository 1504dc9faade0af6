// Two recordings against each other: ticks by their sequence, and replies by the sequence of the newest tick that they answer.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "client/replay/compare_replies.h"
#include "client/recordings/recording.h"

namespace sightline {

struct InputComparison {
  uint64_t ticks = 0, equal = 0;  // that both have
  uint64_t only_a = 0, only_b = 0;
  std::optional<NamedDifference> opening;  // of what the sessions were opened with
  std::optional<ReplyDifference> first;    // tick
};

struct RecordingComparison {
  explicit RecordingComparison(const Convention& convention) : replies(convention) {}
  InputComparison input;
  ReplyComparison replies;
  uint64_t only_a = 0, only_b = 0;        // replies
  uint64_t missing_a = 0, missing_b = 0;  // messages, by gaps
  bool equal() const { return replies.all_equal() && only_a == 0 && only_b == 0; }
};

// Reads both once, side by side. `progress` is told the log time in seconds since the start of `a`. Of the openings, how the
// session is recorded does not count, and of ticks `step`: a replay at a daemon says there what the recording says in its
// replies. Fails when the convention of `a` is none.
Result<RecordingComparison> compare_recordings(const Recording& a, const Recording& b,
                                               const std::function<void(double)>& progress = {});

}  // namespace sightline
