#include "client/recordings/recording.h"

#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <utility>

#include "client/recordings/reply_fields.h"
#include "server/base/hash.h"
#include "server/wire/from_proto_values.h"

namespace sightline {
namespace {

constexpr uint32_t kKnownVersion = 1;

std::string name_of(RecordTopic topic) {
  return all_record_topics()[static_cast<size_t>(topic)].topic;
}

template <typename Message>
bool parse_into(std::string_view bytes, RecordedMessage& out) {
  Message message;
  if (!message.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) return false;
  out = std::move(message);
  return true;
}

bool parse(RecordTopic topic, std::string_view bytes, RecordedMessage& out) {
  switch (topic) {
    case RecordTopic::kTick:
      return parse_into<v1::Tick>(bytes, out);
    case RecordTopic::kReply:
      return parse_into<v1::CameraReply>(bytes, out);
    case RecordTopic::kTickError:
      return parse_into<v1::TickError>(bytes, out);
    case RecordTopic::kFault:
      return parse_into<v1::Fault>(bytes, out);
    case RecordTopic::kGap:
      return parse_into<v1::Gap>(bytes, out);
    case RecordTopic::kMemory:
      return parse_into<v1::StepMemory>(bytes, out);
    default:
      return false;
  }
}

// By the counts of the channels. At least 1, so that a reading begins.
uint64_t messages_on(const McapInfo& info, const std::vector<std::string>& topics) {
  uint64_t count = 0;
  for (const auto& [id, channel] : info.channels) {
    const auto found = info.statistics.channel_message_counts.find(id);
    const bool wanted = std::find(topics.begin(), topics.end(), channel.topic) != topics.end();
    if (wanted && found != info.statistics.channel_message_counts.end()) count += found->second;
  }
  // Statistics need not count by channel.
  const bool counted = !info.statistics.channel_message_counts.empty();
  return counted ? std::max<uint64_t>(count, 1) : std::numeric_limits<uint64_t>::max();
}

std::string session_text(std::string_view bytes) {
  v1::RecordingInfo info;
  if (!info.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) return {};
  return info.session_id() + " (part " + std::to_string(info.part()) + ")";
}

// Merged files: their ticks and replies do not belong together.
std::string several_text(const std::set<std::string>& sessions) {
  constexpr size_t kMost = 4;
  std::string text = "holds " + std::to_string(sessions.size()) + " sessions or parts, which must be read one by one: ";
  size_t named = 0;
  for (const std::string& session : sessions) {
    if (named == kMost) return text.append(", ...");
    text.append(named++ > 0 ? ", " : "").append(session);
  }
  return text;
}

Error not_ours(const std::string& name, std::string why) {
  return {ErrorCode::kInvalidArgument, "recording", name + ": " + std::move(why)};
}

}  // namespace

Result<Convention> convention_of(const v1::OpenSession& open) {
  Convention convention;
  if (Status ok = read_convention(open.convention(), "open.", convention); !ok) return tl::unexpected(ok.error());
  glm::dvec3 origin(0.0);
  if (Status ok = read_vector(open.world_origin(), "open.world_origin", origin); !ok) return tl::unexpected(ok.error());
  convention.origin_m = vector_from_client(convention, origin);
  return convention;
}

uint64_t log_time_after(uint64_t start_ns, double seconds) {
  constexpr uint64_t kEver = std::numeric_limits<uint64_t>::max();
  if (!(seconds > 0)) return start_ns;
  const double ns = std::ceil(seconds * 1e9);
  return ns >= static_cast<double>(kEver - start_ns) ? kEver : start_ns + static_cast<uint64_t>(ns);
}

Result<Recording> Recording::open(const std::string& path, McapLimits limits) {
  auto source = open_file_source(path);
  if (!source) return tl::unexpected(std::move(source.error()));
  return open(std::shared_ptr<const ByteSource>(std::move(*source)), path, limits);
}

Result<Recording> Recording::open(std::shared_ptr<const ByteSource> source, std::string name, McapLimits limits) {
  auto reader = McapReader::open(*source, limits);
  if (!reader) {
    Error error = std::move(reader.error());
    error.message.insert(0, name + ": ");
    return tl::unexpected(std::move(error));
  }
  Recording recording(std::move(source), std::move(name), std::move(*reader));
  if (auto head = recording.read_head(); !head) return tl::unexpected(std::move(head.error()));
  return recording;
}

// The opening stands at the head of our files. Other programs may write it anywhere, so the index is asked where it is.
Status Recording::read_head() {
  bool has_info = false, has_open = false, has_opened = false;
  start_ns_ = container().statistics.start_time_ns;
  McapQuery query;
  for (const RecordTopic topic : {RecordTopic::kInfo, RecordTopic::kOpen, RecordTopic::kOpened})
    query.topics.push_back(name_of(topic));
  uint64_t left = messages_on(container(), query.topics);
  std::set<std::string> sessions;
  const auto take = [](auto& message, bool& has, std::string_view bytes) {
    if (!has) has = message.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()));
  };
  reader_.read(query, [&](const McapMessage& m) {
    const auto topic = record_topic_of(m.channel.topic);
    if (topic == RecordTopic::kInfo)
      take(info_, has_info, m.message.data), sessions.insert(session_text(m.message.data));
    if (topic == RecordTopic::kOpen) take(open_, has_open, m.message.data);
    if (topic == RecordTopic::kOpened) take(opened_, has_opened, m.message.data);
    return --left > 0;
  });
  if (sessions.size() > 1) return tl::unexpected(not_ours(name_, several_text(sessions)));
  if (!has_info) return tl::unexpected(not_ours(name_, "holds no session: the topic /sightline/info is missing"));
  if (info_.layout_version() > kKnownVersion)
    return tl::unexpected(not_ours(name_, "is of version " + std::to_string(info_.layout_version()) +
                                              ", this program knows up to " + std::to_string(kKnownVersion)));
  if (!has_open) return tl::unexpected(not_ours(name_, "the session's opening is missing (/sightline/open)"));
  return {};
}

double Recording::duration_s() const {
  const mcap::Statistics& statistics = container().statistics;
  const uint64_t end_ns = statistics.end_time_ns;
  return end_ns > start_ns_ ? static_cast<double>(end_ns - start_ns_) * 1e-9 : 0.0;
}

RecordedReport Recording::read(const RecordedRange& range, const std::function<bool(RecordedEvent&)>& visit) const {
  McapQuery query{.start_ns = range.start_s > 0 ? log_time_after(start_ns_, range.start_s) : 0,
                  .end_ns = log_time_after(start_ns_, range.end_s)};
  for (const RecordTopic topic : {RecordTopic::kTick, RecordTopic::kReply, RecordTopic::kTickError, RecordTopic::kFault,
                                  RecordTopic::kGap, RecordTopic::kMemory})
    query.topics.push_back(name_of(topic));
  RecordedReport report;
  RecordedEvent event;
  McapReadReport done = reader_.read(query, [&](const McapMessage& m) {
    const auto topic = record_topic_of(m.channel.topic);
    if (!topic || !parse(*topic, m.message.data, event.message)) {
      ++report.undecodable;
      return true;
    }
    event.topic = *topic;
    event.log_ns = m.message.log_time_ns;
    event.publish_ns = m.message.publish_time_ns;
    event.sequence = m.message.sequence;
    ++report.events;
    return visit(event);
  });
  report.loss = std::move(done.loss);
  report.chunks_read = done.chunks_read;
  return report;
}

Result<std::vector<RecordedFile>> Recording::files() const {
  std::vector<RecordedFile> files;
  for (const mcap::AttachmentIndex& index : container().attachments) {
    auto bytes = reader_.attachment(index);
    if (!bytes) return tl::unexpected(std::move(bytes.error()));
    files.push_back({index.name, std::move(*bytes)});
  }
  return files;
}

// --- steps

// A message that stands again at the head of a later part has the number 1: the next one is far behind it.
void StepAssembler::count_missing(const RecordedEvent& event) {
  uint32_t& last = last_[static_cast<size_t>(event.topic)];
  if (event.topic == RecordTopic::kGap)
    last_ = {};  // it says by itself how many are missing
  else if (last > 1 && event.sequence > last + 1)
    step_.missing += event.sequence - last - 1;
  last = event.sequence;
}

bool StepAssembler::add(RecordedEvent& event) {
  count_missing(event);
  switch (event.topic) {
    case RecordTopic::kTick:
      step_.ticks.push_back(std::move(std::get<v1::Tick>(event.message)));
      step_.tick_log_ns.push_back(event.log_ns);
      return false;
    case RecordTopic::kTickError:
      step_.rejections.push_back(std::move(std::get<v1::TickError>(event.message)));
      return false;
    case RecordTopic::kFault:
      step_.faults.push_back(std::move(std::get<v1::Fault>(event.message)));
      return false;
    case RecordTopic::kGap:
      step_.missing += std::get<v1::Gap>(event.message).messages();
      return false;
    case RecordTopic::kMemory:
      step_.memory = std::move(std::get<v1::StepMemory>(event.message));
      step_.ticks_before_memory = step_.ticks.size();
      return false;
    case RecordTopic::kReply:
      step_.reply = std::move(std::get<v1::CameraReply>(event.message));
      step_.log_ns = event.log_ns;
      return true;
    default:
      return false;
  }
}

RecordedStep StepAssembler::take() {
  return std::exchange(step_, {});
}

bool StepAssembler::take_rest(RecordedStep& rest) {
  if (step_.ticks.empty() && step_.rejections.empty() && step_.faults.empty() && step_.missing == 0) return false;
  rest = take();
  rest.has_reply = false;
  return true;
}

const std::string& PlainReply::bytes_of(const v1::CameraReply& reply) {
  plain_.CopyFrom(reply);
  plain_.clear_stage_times();
  if (plain_.has_flags()) plain_.mutable_flags()->clear_recording_degraded();
  clear_fields(plain_, left_out_);
  bytes_.clear();
  google::protobuf::io::StringOutputStream stream(&bytes_);
  google::protobuf::io::CodedOutputStream coded(&stream);
  coded.SetSerializationDeterministic(true);
  plain_.SerializeToCodedStream(&coded);
  coded.Trim();
  return bytes_;
}

uint64_t reply_hash(const v1::CameraReply& reply, uint64_t seed) {
  PlainReply plain;
  return hash64_bytes(std::as_bytes(std::span(plain.bytes_of(reply))), seed);
}

}  // namespace sightline
