// Writes a recording message by message, in the caller's own time: the replies of a replay, or a cut of another
// recording. The daemon writes the same files with server/record/recorder.h, which never waits.
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
  // Creates a new file: kAlreadyExists when there is one. `info` is written unchanged except for its `version`.
  static Result<std::unique_ptr<RecordingWriter>> create(const std::string& path, v1::RecordingInfo info);
  RecordingWriter(std::unique_ptr<ByteSink> sink, const v1::RecordingInfo& info);

  // First the opening, then the rest, in reading order. Messages for viewers are made from these. Viewer messages over
  // kMaxMessageBytes are left out.
  Status write(const v1::OpenSession& open, uint64_t log_ns);
  Status write(const v1::SessionOpened& opened, uint64_t log_ns);
  Status write(const v1::Tick& tick, uint64_t log_ns);
  Status write(const v1::CameraReply& reply, uint64_t log_ns);
  Status write(const v1::TickError& rejection, uint64_t log_ns);
  Status write(const v1::Fault& fault, uint64_t log_ns);
  Status write(const v1::Gap& gap, uint64_t log_ns);
  Status write(const v1::StepMemory& memory, uint64_t log_ns);
  Status attach(const RecordedFile& file, uint64_t log_ns);

  // Writes the summary; nothing may be written after it. Without it the file looks like one whose writer was killed.
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
