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

Result<std::unique_ptr<RecordingWriter>> RecordingWriter::create(const std::string& path,
                                                                 v1::RecordingInfo info) {
  auto sink = create_file_sink(path);
  if (!sink) return tl::unexpected(std::move(sink.error()));
  return std::make_unique<RecordingWriter>(std::move(*sink), info);
}

RecordingWriter::RecordingWriter(std::unique_ptr<ByteSink> sink, const v1::RecordingInfo& info)
    : file_(std::move(sink), versioned(info), info.start_time_ns(), options_for(info)) {}

Status RecordingWriter::put_bytes(RecordTopic topic, uint64_t log_ns, const std::string& bytes) {
  const uint32_t sequence = ++sequences_[static_cast<size_t>(topic)];
  return file_.write({topic, sequence, log_ns, log_ns, bytes}, log_ns);
}

template <typename Message>
Status RecordingWriter::put(RecordTopic topic, const Message& message, uint64_t log_ns,
                            void (ViewerChannels::*take)(const Message&, uint64_t,
                                                         const ViewerChannels::Emit&)) {
  Status done = put_bytes(topic, log_ns, message.SerializeAsString());
  if (!done) return done;
  // As in the daemon's recordings, one that is too large is left out: a session is whole without it.
  (viewers_.*take)(message, log_ns, [&](RecordTopic made_for, const google::protobuf::MessageLite& made) {
    const std::string bytes = made.SerializeAsString();
    if (done && bytes.size() <= kMaxMessageBytes) done = put_bytes(made_for, log_ns, bytes);
  });
  return done;
}

Status RecordingWriter::write(const v1::OpenSession& open, uint64_t log_ns) {
  return put(RecordTopic::kOpen, open, log_ns, &ViewerChannels::take_open);
}
Status RecordingWriter::write(const v1::SessionOpened& opened, uint64_t log_ns) {
  return put_bytes(RecordTopic::kOpened, log_ns, opened.SerializeAsString());
}
Status RecordingWriter::write(const v1::Tick& tick, uint64_t log_ns) {
  return put(RecordTopic::kTick, tick, log_ns, &ViewerChannels::take_tick);
}
Status RecordingWriter::write(const v1::CameraReply& reply, uint64_t log_ns) {
  return put(RecordTopic::kReply, reply, log_ns, &ViewerChannels::take_reply);
}
Status RecordingWriter::write(const v1::TickError& rejection, uint64_t log_ns) {
  return put(RecordTopic::kRejection, rejection, log_ns, &ViewerChannels::take_rejection);
}
Status RecordingWriter::write(const v1::Fault& fault, uint64_t log_ns) {
  return put(RecordTopic::kFault, fault, log_ns, &ViewerChannels::take_fault);
}
Status RecordingWriter::write(const v1::Gap& gap, uint64_t log_ns) {
  return put(RecordTopic::kGap, gap, log_ns, &ViewerChannels::take_gap);
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
