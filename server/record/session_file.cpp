#include "server/record/session_file.h"

#include <google/protobuf/descriptor.h>

#include <utility>

namespace sightline {
namespace {

mcap::Metadata metadata_of(const v1::RecordingInfo& info) {
  return {"sightline",
          {{"version", std::to_string(info.layout_version())},
           {"server_version", info.server_version()},
           {"build", info.build()},
           {"sampler", info.sampler()},
           {"session_id", info.session_id()},
           {"seed", std::to_string(info.seed())},
           {"label", info.label()},
           {"part", std::to_string(info.part())}}};
}

}  // namespace

void LostMessages::add(const LostMessages& later) {
  if (messages == 0) first_time_ns = later.first_time_ns;
  last_time_ns = later.last_time_ns;
  messages += later.messages;
  reported += later.reported;
}

LostMessages lost_with(const RecordMessage& message) {
  LostMessages lost{1, 0, message.log_time_ns, message.log_time_ns};
  if (message.topic != RecordTopic::kGap) return lost;
  v1::Gap gap;
  if (!gap.ParseFromArray(message.bytes.data(), static_cast<int>(message.bytes.size()))) return lost;
  lost.reported = gap.messages();
  lost.first_time_ns = gap.first_time_ns();
  return lost;
}

SessionFile::SessionFile(std::unique_ptr<ByteSink> sink, const v1::RecordingInfo& info, McapWriterOptions options)
    : sink_(std::move(sink)),
      chunk_time_ns_(static_cast<uint64_t>(options.chunk_time.count())),
      writer_(*sink_, std::move(options)),
      info_(info.SerializeAsString()),
      start_ns_(info.start_time_ns()) {
  // The writer keeps its first error, and the first write() returns it.
  (void)writer_.add_metadata(metadata_of(info));
}

Result<uint16_t> SessionFile::channel_of(RecordTopic topic) {
  uint16_t& channel = channels_[static_cast<size_t>(topic)];
  if (channel != 0) return channel;
  const RecordTopicInfo& info = all_record_topics()[static_cast<size_t>(topic)];
  const std::string name(info.message->full_name());
  auto schema = schemas_.find(name);
  if (schema == schemas_.end()) {
    const Result<uint16_t> id = writer_.add_schema(name, "protobuf", descriptor_set_of(*info.message));
    if (!id) return id;
    schema = schemas_.emplace(name, *id).first;
  }
  const Result<uint16_t> id = writer_.add_channel(info.topic, schema->second, "protobuf", {});
  if (id) channel = *id;
  return id;
}

Status SessionFile::write(const RecordMessage& message, uint64_t now_ns) {
  if (!info_.empty()) {
    const std::string info = std::exchange(info_, {});
    const Status done = put({RecordTopic::kInfo, 1, message.log_time_ns, message.log_time_ns, info}, now_ns);
    forget_waiting();
    if (!done) return done;
  }
  return put(message, now_ns);
}

Status SessionFile::put(const RecordMessage& message, uint64_t now_ns) {
  const Result<uint16_t> channel = channel_of(message.topic);
  if (!channel) return tl::unexpected(channel.error());
  const uint64_t before = writer_.bytes_written();
  const Status done = writer_.write(
      {*channel, message.sequence, message.log_time_ns, message.publish_time_ns, message.bytes});
  if (!done) return done;
  if (writer_.bytes_written() != before) chunk_ended();
  if (!writer_.has_open_chunk()) return done;
  if (!chunk_since_ns_) chunk_since_ns_ = now_ns;
  waiting_.add(lost_with(message));
  return done;
}

Status SessionFile::tend(uint64_t now_ns) {
  if (!chunk_since_ns_ || now_ns < *chunk_since_ns_ + chunk_time_ns_) return writer_.status();
  return end_chunk();
}

Status SessionFile::end_chunk() {
  if (!writer_.has_open_chunk()) return writer_.status();
  const Status done = writer_.end_chunk();
  if (done) chunk_ended();
  return done;
}

// A file without any message has its info nevertheless.
Status SessionFile::finish() {
  const std::string info = std::exchange(info_, {});
  if (!info.empty())
    if (const Status done = put({RecordTopic::kInfo, 1, start_ns_, start_ns_, info}, start_ns_); !done) return done;
  return writer_.finish();
}

// The open chunk is written before it.
Status SessionFile::attach(const mcap::Attachment& attachment) {
  const Status done = writer_.attach(attachment);
  if (done) chunk_ended();
  return done;
}

void SessionFile::chunk_ended() {
  waiting_ = {};
  chunk_since_ns_.reset();
  ++chunks_;
}

}  // namespace sightline
