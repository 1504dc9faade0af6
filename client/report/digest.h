// A recording read through once, without its scene: which replies become frames of a page, what happened when, and the
// figures of all replies, whether they become frames or not.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "client/recordings/recording.h"
#include "client/page/session_page.h"
#include "server/session/convention.h"

namespace sightline {

// Something that happened at or before a reply.
struct DigestMark {
  size_t reply = 0;  // index among those of the range
  std::string kind;  // "rejection", "fault", "gap" or "change"
  std::string text;
};

struct TargetSums {
  size_t replies = 0;  // that say something of it
  double visible = 0.0, filtered = 0.0, distance_m = 0.0;
};

// Of all replies of the range.
struct DigestFigures {
  size_t ticks = 0, replies = 0;
  std::map<uint64_t, TargetSums> targets;    // by id
  size_t with_targets = 0, all_visible = 0;  // replies that say something of a target; of them, all VISIBLE
  std::map<std::string, size_t> statuses, reasons;
  double travel_m = 0.0;  // between poses; cuts do not count
  size_t cuts = 0, merged_ticks = 0, degraded = 0, recording_degraded = 0;
  uint64_t rejections = 0, faults = 0, missing = 0;  // `missing`: messages that gaps speak of
  std::vector<std::vector<double>> stage_us;  // by stage of page_stages(), each as long as there are replies
  std::vector<double> total_us, queue_us,
      answer_ms;  // answer: from the arrival of the newest tick to its reply
};

struct RecordingDigest {
  std::vector<bool> kept;  // by reply of the range: whether it becomes a frame
  size_t frames = 0;       // how many do
  size_t changes = 0,
         kept_changes = 0;  // of replies with a change or a cut: all, and those that become frames
  uint64_t first_log_ns = 0;
  bool has_candidates = false;
  size_t candidates = 0;          // most of one reply
  std::vector<DigestMark> marks;  // at most kMaxMarks
  uint64_t left_out_marks = 0;
  DigestFigures figures;
  RecordedReport read;
};

inline constexpr size_t kMaxMarks = 2000;
// Where instances stood, of all frames of a page together: when there are more, frames are left out.
inline constexpr size_t kMaxPagePoses = 2'000'000;

struct DigestOptions {
  RecordedRange range;
  size_t max_frames = 20'000;  // at least 2
  std::function<void(size_t replies)> progress = {};
};

// Replies with a change of status, reason or flags, cuts, the first and the last are kept before others; the others
// evenly spaced. Poses in ticks count as well: see kMaxPagePoses.
RecordingDigest digest_recording(const Recording& recording, const Convention& convention,
                                 const DigestOptions& options);

// Ready to be read.
std::vector<PageFigure> figures_of(const DigestFigures& figures,
                                   const std::map<uint64_t, std::string>& names);

}  // namespace sightline
