// One file of one session: its topics as MCAP channels, the info at its head, and chunks that are closed by the clock.
#pragma once

#include <array>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "server/record/mcap_writer.h"
#include "server/record/record_topics.h"
#include "sightline/v1/recording.pb.h"

namespace sightline {

// One message on its way into a file.
struct RecordMessage {
  RecordTopic topic = RecordTopic::kInfo;
  uint32_t sequence = 0;  // within its topic; missing numbers are dropped messages
  uint64_t log_time_ns = 0;
  uint64_t publish_time_ns = 0;
  std::string_view bytes;  // serialised
};

// Messages that are lost together, with the log times of the first and the last of them.
struct LostMessages {
  uint64_t messages = 0;
  uint64_t reported = 0;  // earlier losses that Gaps among these messages report
  uint64_t first_time_ns = 0;
  uint64_t last_time_ns = 0;

  void add(const LostMessages& later);
};

// The messages that a recording lacks when it lacks this one. A lost Gap adds the messages that it reports.
LostMessages lost_with(const RecordMessage& message);

// Not thread-safe.
class SessionFile {
 public:
  // Owns the sink. Writes the metadata "sightline", for tools without protobuf. The info, as a message, is written with
  // the first message and has the time of that message, so that a tool that sorts by time leaves it in front.
  SessionFile(std::unique_ptr<ByteSink> sink, const v1::RecordingInfo& info, McapWriterOptions options);

  Status write(const RecordMessage& message, uint64_t now_ns);
  Status attach(const mcap::Attachment& attachment);
  // Closes the chunk when its first message has waited for `chunk_time`. Call it at least that often.
  Status tend(uint64_t now_ns);
  // Closes the chunk now.
  Status end_chunk();
  Status finish();

  // Messages taken but not yet handed to the sink. They are lost when the sink fails.
  const LostMessages& waiting() const { return waiting_; }
  // The messages so far need not be reported when they are lost, since they stand elsewhere too.
  void forget_waiting() { waiting_ = {}; }
  uint64_t bytes() const { return writer_.bytes_written(); }
  const Status& status() const { return writer_.status(); }
  uint64_t chunks() const { return chunks_; }  // handed to the sink

 private:
  Status put(const RecordMessage& message, uint64_t now_ns);
  void chunk_ended();
  Result<uint16_t> channel_of(RecordTopic topic);

  const std::unique_ptr<ByteSink> sink_;
  const uint64_t chunk_time_ns_;
  McapWriter writer_;
  std::array<uint16_t, kRecordTopics> channels_{};  // by topic; 0: not added yet
  std::map<std::string, uint16_t> schemas_;         // by the message's name
  std::string info_;                                // until it is written
  uint64_t start_ns_;
  LostMessages waiting_;
  uint64_t chunks_ = 0;
  std::optional<uint64_t> chunk_since_ns_;  // by the clock; empty: no message waits
};

}  // namespace sightline
