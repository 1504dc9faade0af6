// Summarises a recording from the file's own summary and its first chunk. Only an unfinished file is read completely.
#pragma once

#include <map>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <ostream>
#include <string>
#include <vector>

#include "client/recordings/game_time.h"
#include "client/recordings/recording.h"

namespace sightline {

struct TopicSummary {
  std::string topic, type;  // name of the schema; may be empty
  uint64_t messages = 0;
};

struct RecordingSummary {
  std::string name;
  uint64_t bytes = 0;
  // Absent when the file holds no Sightline session; `not_a_session` then says why, and the file is still MCAP.
  std::optional<v1::RecordingInfo> session;
  std::string not_a_session;
  uint64_t ticks = 0;  // without a snapshot tick
  uint64_t replies = 0, rejections = 0, faults = 0;
  uint64_t merged = 0;  // ticks that were answered together with a later one, by the counts
  // Messages that Gaps report as missing, by reason; only the first kMaxGaps Gaps are read.
  std::map<std::string, uint64_t> missing;
  uint64_t gaps = 0;
  std::map<std::string, std::string> cut;        // the metadata of a cut; empty: the file is no cut
  std::map<std::string, std::string> recovered;  // what was lost before it was recovered; empty: it never was recovered

  std::optional<GameTime> game_time;  // empty: the file holds no tick
  uint64_t start_ns = 0, end_ns = 0;  // of the first and the last message, log time
  uint64_t chunks = 0, packed_bytes = 0, unpacked_bytes = 0;
  std::string compression;  // "zstd"; several with commas
  std::vector<TopicSummary> topics;
  std::vector<mcap::AttachmentIndex> attachments;
  bool finished = false;
  std::vector<std::string> absent;  // McapInfo::absent
  McapLoss loss;

  static constexpr uint64_t kMaxGaps = 100;
  double duration_s() const { return end_ns > start_ns ? static_cast<double>(end_ns - start_ns) * 1e-9 : 0.0; }
};

// Fails as Recording::open does, but also accepts MCAP files that are no recordings.
Result<RecordingSummary> summarise_recording(std::shared_ptr<const ByteSource> source, const std::string& name,
                                             McapLimits limits = {});

void print_summary(std::ostream& out, const RecordingSummary& summary);
nlohmann::ordered_json json_of(const RecordingSummary& summary);

// Metadata that a cut and a recovered file carry (server/record/FORMAT.md).
inline constexpr char kCutMetadata[] = "sightline.cut";
inline constexpr char kRecoveredMetadata[] = "sightline.recovered";

// "hall.mcap: data loss: is not an MCAP file". The name stands once, even when the error has it already.
std::string error_text(const std::string& name, const Error& error);
// "1 chunk, 20 messages, 1.5 KiB"; "nothing".
std::string loss_text(const McapLoss& loss);
nlohmann::ordered_json json_of(const McapLoss& loss);
// Prints what the summary of a file lacks though the format lets it; nothing when it lacks nothing.
void print_absent(std::ostream& out, const std::vector<std::string>& absent);
// Prints the kept troubles, one a line, with their place in the file.
void print_troubles(std::ostream& out, const McapLoss& loss);

}  // namespace sightline
