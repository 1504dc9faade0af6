// A recording as a session: how it was opened, and then everything that happened, in order. server/record/FORMAT.md
// describes the files, server/record/mcap_reader.h the container.
//
//   auto recording = Recording::open("hall.mcap");
//   recording->read({}, [](const RecordedEvent& event) { ...; return true; });
//
// Files may come from anywhere: messages that cannot be decoded are counted and skipped.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "server/base/error.h"
#include "server/record/byte_io.h"
#include "server/record/mcap_reader.h"
#include "server/record/record_topics.h"
#include "server/session/convention.h"
#include "sightline/v1/camera_control.pb.h"
#include "sightline/v1/recording.pb.h"

namespace sightline {

// Messages for viewers and those at the head of the file are not among them.
using RecordedMessage = std::variant<v1::Tick, v1::CameraReply, v1::TickError, v1::Fault, v1::Gap, v1::StepMemory>;

struct RecordedEvent {
  RecordTopic topic = RecordTopic::kTick;  // kTick, kReply, kTickError, kFault, kGap or kMemory, as `message` holds
  uint64_t log_ns = 0;                     // when the server had it, since 1970 (UTC)
  uint64_t publish_ns = 0;                 // when the client sent it, or log_ns
  uint32_t sequence = 0;                   // within its topic; missing numbers are lost messages
  RecordedMessage message;
};

// Seconds of log time since the first message of the file: start <= t < end.
struct RecordedRange {
  double start_s = 0.0;
  double end_s = std::numeric_limits<double>::infinity();
};

// The log time so many seconds after `start_ns`; nothing is later than the end of time.
uint64_t log_time_after(uint64_t start_ns, double seconds);

struct RecordedReport {
  uint64_t events = 0;
  uint64_t undecodable = 0;  // messages of Sightline's topics that do not fit their schema
  uint64_t chunks_read = 0;
  McapLoss loss;  // as McapReader::read counts it
};

// A scene file that travels in the recording.
struct RecordedFile {
  std::string name;  // "scene/levels/one.gltf": below the scene folder; "upload/<hash>": uploaded bytes
  std::string bytes;
};

// Reading does not change it. For one thread at a time.
class Recording {
 public:
  // Fails with kNotFound, kUnavailable or kDataLoss when the file cannot be read as MCAP. Fails with kInvalidArgument
  // (field "recording") when it holds no Sightline session or several, or is of a later version than this program
  // knows. Reads the tail of the file and the chunks with the opening.
  static Result<Recording> open(const std::string& path, McapLimits limits = {});
  // The same of any bytes; `name` is for errors.
  static Result<Recording> open(std::shared_ptr<const ByteSource> source, std::string name, McapLimits limits = {});

  const std::string& name() const { return name_; }
  const v1::RecordingInfo& info() const { return info_; }
  const v1::OpenSession& open_session() const { return open_; }
  const v1::SessionOpened& opened() const { return opened_; }  // empty when the file ends before it
  const McapInfo& container() const { return reader_.info(); }
  const McapReader& reader() const { return reader_; }
  uint64_t start_ns() const { return start_ns_; }  // of the first message, log time
  double duration_s() const;                       // from the first to the last message

  // Hands every event of the range to `visit`, in the order in which they happened, until it answers false. The event
  // may be moved from. Only the chunks that the range touches are read.
  RecordedReport read(const RecordedRange& range, const std::function<bool(RecordedEvent&)>& visit) const;

  // The attached scene files; may be empty. Fails when one of them is damaged.
  Result<std::vector<RecordedFile>> files() const;

 private:
  Recording(std::shared_ptr<const ByteSource> source, std::string name, McapReader reader)
      : source_(std::move(source)), name_(std::move(name)), reader_(std::move(reader)) {}
  Status read_head();

  std::shared_ptr<const ByteSource> source_;
  std::string name_;
  McapReader reader_;
  v1::RecordingInfo info_;
  v1::OpenSession open_;
  v1::SessionOpened opened_;
  uint64_t start_ns_ = 0;
};

// The level of degradation of the step, clamped to [0, 5]: the argument of Session::step.
inline int quality_level_of(const v1::CameraReply& reply) {
  return static_cast<int>(std::min(reply.degradation().quality_level(), 5u));
}

// The convention of a session's poses, with its world origin. Fails as opening the session would.
Result<Convention> convention_of(const v1::OpenSession& open);

// One step as it was taken: the ticks that were applied for it, oldest first, then its reply.
struct RecordedStep {
  // Includes refused ticks, whose rejections stand below: a replay refuses them again.
  std::vector<v1::Tick> ticks;
  std::vector<uint64_t> tick_log_ns;  // of each
  std::vector<v1::TickError> rejections;
  std::vector<v1::Fault> faults;
  // The server's memory, and how many of `ticks` stand before it. The head of a later part has it after its snapshot
  // tick.
  std::optional<v1::StepMemory> memory;
  size_t ticks_before_memory = 0;
  v1::CameraReply reply;
  uint64_t log_ns = 0;    // of the reply
  uint64_t missing = 0;   // messages lost since the step before; later replies may then differ in a replay
  bool has_reply = true;  // false: the file ends with ticks that nothing answers
  int quality_level() const { return quality_level_of(reply); }
};

// Assembles steps from events. Feed it every event of a recording in order. Messages that are missing without a Gap,
// after a damaged chunk, are counted by the numbers of their topics.
class StepAssembler {
 public:
  // Returns true when the step is complete; take() then returns it.
  bool add(RecordedEvent& event);
  RecordedStep take();
  // Returns the ticks without a reply at the end of the recording; false when there are none.
  bool take_rest(RecordedStep& rest);

 private:
  void count_missing(const RecordedEvent& event);

  RecordedStep step_;
  std::array<uint32_t, kRecordTopics> last_{};  // number by topic; 0: the next number may be any
};

// A 64-bit hash of a reply without its stage times and its recording flag. Equal inputs give equal hashes on one
// sampler. Chained: pass the hash of the reply before as `seed` to cover a session.
uint64_t reply_hash(const v1::CameraReply& reply, uint64_t seed = 0);

// The bytes that reply_hash covers. Reuses its memory from reply to reply.
class PlainReply {
 public:
  // `left_out`: fields that the bytes lack in addition, as of reply_fields_unknown_to.
  explicit PlainReply(std::vector<const google::protobuf::FieldDescriptor*> left_out = {})
      : left_out_(std::move(left_out)) {}

  // Valid until the next call.
  const std::string& bytes_of(const v1::CameraReply& reply);

 private:
  const std::vector<const google::protobuf::FieldDescriptor*> left_out_;
  v1::CameraReply plain_;
  std::string bytes_;
};

}  // namespace sightline
