// Writes a recording message by message, in the caller's own time: what a replay answered, a cut of another recording.
// The daemon's own way, which never waits, is server/record/recorder.h; both write the same files.
#pragma once

#include <array>
#include <memory>
#include <string>

#include "client/recordings/recording.h"
#include "server/record/session_file.h"
#include "server/record/viewer_channels.h"

namespace sightline {

// Not thread-safe. Errors of the file stick: every later call says the same.
class RecordingWriter {
 public:
  // A new file: kAlreadyExists when there is one. `info` is written as it is but for its `version`.
  static Result<std::unique_ptr<RecordingWriter>> create(const std::string& path, v1::RecordingInfo info);
  RecordingWriter(std::unique_ptr<ByteSink> sink, const v1::RecordingInfo& info);

  // First the opening, then the rest, in the order in which they are to be read. Messages for viewers are made of them; of
  // those, ones over kMaxMessageBytes are left out.
  Status write(const v1::OpenSession& open, uint64_t log_ns);
  Status write(const v1::SessionOpened& opened, uint64_t log_ns);
  Status write(const v1::Tick& tick, uint64_t log_ns);
  Status write(const v1::CameraReply& reply, uint64_t log_ns);
  Status write(const v1::TickError& rejection, uint64_t log_ns);
  Status write(const v1::Fault& fault, uint64_t log_ns);
  Status write(const v1::Gap& gap, uint64_t log_ns);
  Status attach(const RecordedFile& file, uint64_t log_ns);

  // The summary; nothing may be written after it. Without it the file is one that a kill left.
  Status finish() { return file_.finish(); }

 private:
  Status put(RecordTopic topic, const google::protobuf::MessageLite& message, uint64_t log_ns);
  // Writes what `make` emits.
  template <typename Make>
  Status put_for_viewers(uint64_t log_ns, const Make& make);

  SessionFile file_;
  SessionSnapshot snapshot_;
  ViewerChannels viewers_{snapshot_};
  std::array<uint32_t, kRecordTopics> sequences_{};
};

}  // namespace sightline
