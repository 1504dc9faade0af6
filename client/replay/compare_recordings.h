// Compares two recordings: ticks by their sequence, and replies by the sequence of the newest tick that they answer.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "client/recordings/recording.h"
#include "client/replay/compare_replies.h"

namespace sightline {

struct InputComparison {
  uint64_t ticks = 0, equal = 0;  // in both
  uint64_t only_a = 0, only_b = 0;
  std::optional<FieldDifference> opening;  // between the openings
  std::optional<ReplyDifference> first;    // tick
};

struct RecordingComparison {
  RecordingComparison(const Convention& convention, const IgnoredFields& unknown) : replies(convention, unknown) {}
  InputComparison input;
  ReplyComparison replies;
  uint64_t only_a = 0, only_b = 0;        // replies
  uint64_t missing_a = 0, missing_b = 0;  // messages, by gaps
  bool equal() const { return replies.all_equal() && only_a == 0 && only_b == 0; }
};

// Reads both once, side by side. `progress` is called with the log time in seconds since the start of `a`. Two kinds of
// fields do not count: the fields of the openings about how the session is recorded, and `step` of the ticks. A replay
// at a daemon fills `step` with values from the recorded replies. Nor do fields of replies that the server of one
// recording did not know. Fails when the convention of `a` is invalid.
Result<RecordingComparison> compare_recordings(const Recording& a, const Recording& b,
                                               const std::function<void(double)>& progress = {});

}  // namespace sightline
