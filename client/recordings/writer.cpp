#include "client/recordings/writer.h"

#include <utility>

namespace sightline {
namespace {

constexpr uint32_t kVersion = 1;  // FORMAT.md

v1::RecordingInfo versioned(v1::RecordingInfo info) {
  info.set_layout_version(kVersion);
  return info;
}

McapWriterOptions options_for(const v1::RecordingInfo& info) {
  McapWriterOptions options;
  options.library.assign("sightline ").append(info.server_version());
  return options;
}

}  // namespace

Result<std::unique_ptr<RecordingWriter>> RecordingWriter::create(const std::string& path, v1::RecordingInfo info) {
  auto sink = create_file_sink(path);
  if (!sink) return tl::unexpected(std::move(sink.error()));
  return std::make_unique<RecordingWriter>(std::move(*sink), info);
}

RecordingWriter::RecordingWriter(std::unique_ptr<ByteSink> sink, const v1::RecordingInfo& info)
    : file_(std::move(sink), versioned(info), options_for(info)) {}

Status RecordingWriter::put(RecordTopic topic, const google::protobuf::MessageLite& message, uint64_t log_ns) {
  const uint32_t sequence = ++sequences_[static_cast<size_t>(topic)];
  return file_.write({topic, sequence, log_ns, log_ns, message.SerializeAsString()}, log_ns);
}

// As in the daemon's recordings, a message that is too large is left out: a session is complete without it.
template <typename Make>
Status RecordingWriter::put_for_viewers(uint64_t log_ns, const Make& make) {
  Status done;
  make([&](RecordTopic topic, const google::protobuf::MessageLite& made) {
    if (done && made.ByteSizeLong() <= kMaxMessageBytes) done = put(topic, made, log_ns);
  });
  return done;
}

Status RecordingWriter::write(const v1::OpenSession& open, uint64_t log_ns) {
  if (Status done = put(RecordTopic::kOpen, open, log_ns); !done) return done;
  snapshot_.take_open(open);
  viewers_.take_open(open);
  return put_for_viewers(log_ns, [&](const auto& emit) { viewers_.emit_still(log_ns, emit); });
}
Status RecordingWriter::write(const v1::SessionOpened& opened, uint64_t log_ns) {
  return put(RecordTopic::kOpened, opened, log_ns);
}
Status RecordingWriter::write(const v1::Tick& tick, uint64_t log_ns) {
  snapshot_.take_tick(tick, {});
  return put(RecordTopic::kTick, tick, log_ns);
}
Status RecordingWriter::write(const v1::CameraReply& reply, uint64_t log_ns) {
  if (Status done = put(RecordTopic::kReply, reply, log_ns); !done) return done;
  snapshot_.take_reply(reply);
  return put_for_viewers(log_ns, [&](const auto& emit) { viewers_.take_reply(reply, log_ns, emit); });
}
Status RecordingWriter::write(const v1::TickError& rejection, uint64_t log_ns) {
  if (Status done = put(RecordTopic::kTickError, rejection, log_ns); !done) return done;
  snapshot_.take_rejection(rejection);
  return put_for_viewers(log_ns, [&](const auto& emit) { viewers_.take_rejection(rejection, log_ns, emit); });
}
Status RecordingWriter::write(const v1::Fault& fault, uint64_t log_ns) {
  if (Status done = put(RecordTopic::kFault, fault, log_ns); !done) return done;
  return put_for_viewers(log_ns, [&](const auto& emit) { viewers_.take_fault(fault, log_ns, emit); });
}
Status RecordingWriter::write(const v1::Gap& gap, uint64_t log_ns) {
  if (Status done = put(RecordTopic::kGap, gap, log_ns); !done) return done;
  return put_for_viewers(log_ns, [&](const auto& emit) { viewers_.take_gap(gap, log_ns, emit); });
}
Status RecordingWriter::write(const v1::StepMemory& memory, uint64_t log_ns) {
  return put(RecordTopic::kMemory, memory, log_ns);
}

Status RecordingWriter::attach(const RecordedFile& file, uint64_t log_ns) {
  mcap::Attachment attachment;
  attachment.log_time_ns = attachment.create_time_ns = log_ns;
  attachment.name = file.name;
  attachment.content_type = "application/octet-stream";
  attachment.data = file.bytes;
  return file_.attach(attachment);
}

}  // namespace sightline
