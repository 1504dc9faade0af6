// Reads a recording once, without its scene. Decides which replies become frames of a page, lists the events, and sums
// up the figures of all replies, frames or not.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "client/recordings/recording.h"
#include "client/report/figures.h"
#include "server/session/convention.h"

namespace sightline {

// Something that happened at or before a reply.
struct DigestMark {
  size_t reply = 0;  // index among the replies of the range
  std::string kind;  // "rejection", "fault", "gap" or "change"
  std::string text;
};

struct RecordingDigest {
  explicit RecordingDigest(const Convention& convention) : replies(convention) {}

  std::vector<bool> kept;  // for each reply of the range, whether it becomes a frame
  size_t frames = 0;       // replies that become frames
  size_t changes = 0,
         kept_changes = 0;  // replies with a change or a cut: all of them, and those that become frames
  uint64_t first_log_ns = 0;
  bool has_candidates = false;
  size_t candidates = 0;          // the largest number in one reply
  std::vector<DigestMark> marks;  // at most kMaxMarks
  uint64_t left_out_marks = 0;
  ReplyFigures replies;           // all replies of the range
  std::vector<double> answer_ms;  // from the arrival of a tick to its reply, for replies whose tick is known
  uint64_t ticks = 0, rejections = 0, faults = 0;
  uint64_t missing = 0;  // messages that gaps report as lost
  RecordedReport read;
};

inline constexpr size_t kMaxMarks = 2000;
// Poses of instances in all frames of a page together. When there would be more, frames are left out.
inline constexpr size_t kMaxPagePoses = 2'000'000;

struct DigestOptions {
  RecordedRange range;
  size_t max_frames = 20'000;  // at least 2
  std::function<void(size_t replies)> progress = {};
};

// Keeps the first and the last reply, and those with a cut or a change of status, reason or flags, before others. The
// others are thinned evenly. The number of poses in the ticks limits the frames too: see kMaxPagePoses.
RecordingDigest digest_recording(const Recording& recording, const Convention& convention,
                                 const DigestOptions& options);

// One line of JSON with the names of the .proto file; empty when the message cannot be printed.
std::string json_of(const google::protobuf::Message& message);

// The figures of the page, ready to be read. `names`: of targets, by id.
std::vector<FigureRow> figures_of(const RecordingDigest& digest, const std::map<uint64_t, std::string>& names);

// Facts for the head of the page, name and value each.
std::vector<std::pair<std::string, std::string>> facts_of(const Recording& recording, const RecordingDigest& digest);

// Warnings that a reader needs before trusting the page, one sentence each: the file is unfinished, damaged or only a
// part, messages are missing, frames were left out.
std::vector<std::string> notices_of(const Recording& recording, const RecordingDigest& digest);

}  // namespace sightline
