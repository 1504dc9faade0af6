#include "client/recordings/cut.h"

#include <array>
#include <filesystem>
#include <map>
#include <optional>
#include <vector>

#include "client/base/text_table.h"
#include "client/recordings/summary.h"
#include "server/record/session_snapshot.h"

namespace sightline {
namespace {

// A message that is written later than it is read.
struct KeptMessage {
  mcap::Channel channel;
  std::optional<mcap::Schema> schema;
  uint32_t sequence = 0;
  uint64_t publish_ns = 0;
  std::string bytes;
};

class Cutter {
 public:
  Cutter(const Recording& recording, const RecordedRange& range, ByteSink& sink)
      : recording_(recording),
        range_(range),
        start_ns_(log_time_after(recording.start_ns(), range.start_s)),
        end_ns_(log_time_after(recording.start_ns(), range.end_s)),
        writer_(sink,
                {.profile = recording.container().header.profile, .library = recording.container().header.library}),
        snapshot_next_(recording.info().snapshot_ticks() > 0) {
    snapshot_.take_open(recording.open_session());
  }

  Result<RecordingCut> run() {
    find_lead();
    if (Status ok = copy_beside(); !ok) return tl::unexpected(ok.error());
    const McapReadReport report = recording_.reader().read({}, [this](const McapMessage& m) { return take(m); });
    if (trouble_) return tl::unexpected(*trouble_);
    if (place_ != Place::kWithin || done_.messages == 0)
      return invalid(place_ == Place::kWithin ? "end_s" : "start_s",
                     formatted("the recording has nothing in this range; it lasts %.3f s", recording_.duration_s()));
    if (Status ok = writer_.finish(); !ok) return tl::unexpected(ok.error());
    add_loss(recording_.container().loss);
    if (recording_.container().loss.none()) add_loss(report.loss);
    return std::move(done_);
  }

 private:
  enum class Place { kBefore, kLead, kWithin };

  // The range may begin with the session itself, which needs no memory.
  void find_lead() {
    if (range_.start_s <= 0) return;
    const McapQuery memories{.end_ns = start_ns_,
                             .topics = {all_record_topics()[static_cast<size_t>(RecordTopic::kMemory)].topic}};
    recording_.reader().read(memories, [this](const McapMessage& m) {
      lead_ns_ = m.message.log_time_ns;
      return true;
    });
    const v1::RecordingInfo& info = recording_.info();
    if (!lead_ns_ && info.snapshot_ticks() == 0 && info.part() <= 1 && range_.start_s < kMostLeadS) {
      lead_ns_ = recording_.start_ns();
      leads_from_start_ = true;
    }
    if (lead_ns_) done_.lead_s = static_cast<double>(start_ns_ - *lead_ns_) * 1e-9;
  }

  // Copies metadata and attachments.
  Status copy_beside() {
    for (const mcap::MetadataIndex& index : recording_.container().metadata) {
      if (index.name == kCutMetadata) continue;
      const auto metadata = recording_.reader().metadata(index);
      if (!metadata) return tl::unexpected(metadata.error());
      if (Status ok = writer_.add_metadata(*metadata); !ok) return ok;
    }
    const std::string end = range_.end_s < recording_.duration_s() ? formatted("%.3f", range_.end_s)
                                                                   : formatted("%.3f", recording_.duration_s());
    const mcap::Metadata cut{kCutMetadata,
                             {{"of", std::filesystem::path(recording_.name()).filename().string()},
                              {"start_s", formatted("%.3f", range_.start_s)},
                              {"lead_s", formatted("%.3f", done_.lead_s)},
                              {"end_s", end}}};
    if (Status ok = writer_.add_metadata(cut); !ok) return ok;
    for (const mcap::AttachmentIndex& index : recording_.container().attachments) {
      const auto bytes = recording_.reader().attachment(index);
      if (!bytes) return tl::unexpected(bytes.error());
      Status ok = writer_.attach({index.log_time_ns, index.create_time_ns, index.name, index.content_type, *bytes, 0});
      if (!ok) return ok;
      ++done_.attachments;
    }
    return {};
  }

  bool take(const McapMessage& m) {
    move_on(m);
    if (place_ == Place::kBefore) {
      remember(m);
      return true;
    }
    if (place_ == Place::kLead) {
      take_lead(m);
      return !trouble_;
    }
    if (m.message.log_time_ns >= end_ns_) return false;
    note(write(m.channel, m.schema, m.message));
    ++done_.messages;
    return !trouble_;
  }

  void move_on(const McapMessage& m) {
    const auto topic = record_topic_of(m.channel.topic);
    const uint64_t now_ns = m.message.log_time_ns;
    if (place_ == Place::kBefore && lead_ns_ && now_ns >= *lead_ns_ && now_ns < start_ns_ &&
        (leads_from_start_ || topic == RecordTopic::kMemory)) {
      place_ = Place::kLead;
      if (!leads_from_start_) write_head();
    }
    if (place_ == Place::kWithin || (range_.start_s > 0 && now_ns < start_ns_)) return;
    if (place_ == Place::kBefore && range_.start_s > 0) write_head();
    if (place_ == Place::kLead) write_still(start_ns_ - 1);
    place_ = Place::kWithin;
  }

  // Viewers see the range alone, with the still frames that hold when it begins.
  void take_lead(const McapMessage& m) {
    const auto topic = record_topic_of(m.channel.topic);
    if (topic == RecordTopic::kStaticFrames || topic == RecordTopic::kShapes) keep(*topic, m);
    if (topic == RecordTopic::kLevel) keep_level(m);
    if (!topic || *topic > RecordTopic::kMemory) return;
    note(write(m.channel, m.schema, m.message));
    ++done_.lead_messages;
  }

  void remember(const McapMessage& m) {
    const auto topic = record_topic_of(m.channel.topic);
    if (!topic) return;
    switch (*topic) {
      case RecordTopic::kOpen:
      case RecordTopic::kOpened:
      case RecordTopic::kInfo:
      case RecordTopic::kStaticFrames:
      case RecordTopic::kShapes:
        return keep(*topic, m);
      case RecordTopic::kLevel:
        return keep_level(m);
      case RecordTopic::kTick:
        return parsed<v1::Tick>(m, [&](v1::Tick& tick) { take_tick(tick, m.message); });
      case RecordTopic::kReply:
        return parsed<v1::CameraReply>(m, [&](const v1::CameraReply& reply) { snapshot_.take_reply(reply); });
      case RecordTopic::kTickError:
        return parsed<v1::TickError>(m, [&](const v1::TickError& refused) { snapshot_.take_rejection(refused); });
      case RecordTopic::kGap:
        return parsed<v1::Gap>(m, [&](const v1::Gap& gap) { take_gap(gap, m); });
      default:
        return;
    }
  }

  // Keeps the first message of the opening's topics, and the newest of the viewers' topics.
  void keep(RecordTopic topic, const McapMessage& m) {
    auto& kept = kept_[static_cast<size_t>(topic)];
    if (kept && topic <= RecordTopic::kOpened) return;
    kept = KeptMessage{m.channel, {}, m.message.sequence, m.message.publish_time_ns, std::string(m.message.data)};
    if (m.schema) kept->schema = *m.schema;
  }

  // The first one holds the level, later ones remove nodes from it.
  void keep_level(const McapMessage& m) {
    keep(RecordTopic::kLevel, m);
    level_.push_back(*kept_[static_cast<size_t>(RecordTopic::kLevel)]);
    kept_[static_cast<size_t>(RecordTopic::kLevel)].reset();
  }

  template <typename Message, typename Take>
  static void parsed(const McapMessage& m, const Take& take) {
    Message message;
    if (message.ParseFromArray(m.message.data.data(), static_cast<int>(m.message.data.size()))) take(message);
  }

  void take_tick(v1::Tick& tick, const mcap::Message& m) {
    tick_channel_id_ = m.channel_id;
    const TickStamp stamp{m.sequence, m.log_time_ns, m.publish_time_ns};
    if (std::exchange(snapshot_next_, false))
      snapshot_.take_snapshot_tick(tick, recording_.info().snapshot_ticks(), stamp);
    else
      snapshot_.take_tick(std::move(tick), stamp);
  }

  // The snapshot tick does not contain what Gaps report: one Gap for all of them, with the reason of the first.
  void take_gap(const v1::Gap& gap, const McapMessage& m) {
    keep(RecordTopic::kGap, m);
    if (lost_.messages() == 0) {
      lost_ = gap;
      return;
    }
    lost_.set_last_time_ns(gap.last_time_ns());
    lost_.set_messages(lost_.messages() + gap.messages());
  }

  void write_head() {
    const bool has_snapshot = snapshot_.ticks() > 0;
    const uint64_t now_ns = has_snapshot ? snapshot_.stamp().log_ns : start_ns_;
    done_.snapshot_ticks = snapshot_.ticks();
    if (auto& info = kept_[static_cast<size_t>(RecordTopic::kInfo)]) {
      v1::RecordingInfo told = recording_.info();
      told.set_snapshot_ticks(snapshot_.ticks());
      info->bytes = told.SerializeAsString();
    }
    auto gap = std::exchange(kept_[static_cast<size_t>(RecordTopic::kGap)], std::nullopt);
    for (const auto& kept : kept_)
      if (kept) write_kept(*kept, now_ns);
    write_level(now_ns);
    if (has_snapshot) write_tick(snapshot_.tick(), snapshot_.stamp());
    for (const WaitingTick& waiting : snapshot_.waiting()) write_tick(waiting.tick, waiting.stamp);
    if (!gap) return;
    gap->bytes = lost_.SerializeAsString();
    write_kept(*gap, now_ns);
  }

  void write_still(uint64_t now_ns) {
    for (const RecordTopic topic : {RecordTopic::kStaticFrames, RecordTopic::kShapes})
      if (auto kept = std::exchange(kept_[static_cast<size_t>(topic)], std::nullopt)) write_kept(*kept, now_ns);
    write_level(now_ns);
  }

  void write_level(uint64_t now_ns) {
    for (const KeptMessage& kept : std::exchange(level_, {})) write_kept(kept, now_ns);
  }

  void write_kept(const KeptMessage& kept, uint64_t now_ns) {
    note(write(kept.channel, kept.schema ? &*kept.schema : nullptr,
               {0, kept.sequence, now_ns, kept.publish_ns, kept.bytes}));
  }

  void write_tick(const v1::Tick& tick, const TickStamp& stamp) {
    const auto& channels = recording_.container().channels;
    const auto channel = channels.find(tick_channel_id_);
    if (channel == channels.end()) return;
    const auto schema = recording_.container().schemas.find(channel->second.schema_id);
    const std::string bytes = tick.SerializeAsString();
    note(write(channel->second, schema == recording_.container().schemas.end() ? nullptr : &schema->second,
               {0, stamp.sequence, stamp.log_ns, stamp.publish_ns, bytes}));
  }

  Status write(const mcap::Channel& channel, const mcap::Schema* schema, mcap::Message message) {
    const Result<uint16_t> id = channel_of(channel, schema);
    if (!id) return tl::unexpected(id.error());
    message.channel_id = *id;
    return writer_.write(message);
  }

  Result<uint16_t> channel_of(const mcap::Channel& channel, const mcap::Schema* schema) {
    if (const auto known = channels_.find(channel.id); known != channels_.end()) return known->second;
    uint16_t schema_id = 0;
    if (schema) {
      auto known = schemas_.find(schema->id);
      if (known == schemas_.end()) {
        const Result<uint16_t> made = writer_.add_schema(schema->name, schema->encoding, schema->data);
        if (!made) return made;
        known = schemas_.emplace(schema->id, *made).first;
      }
      schema_id = known->second;
    }
    const Result<uint16_t> made = writer_.add_channel(channel.topic, schema_id, channel.message_encoding,
                                                      channel.metadata);
    if (made) channels_.emplace(channel.id, *made);
    return made;
  }

  void note(const Status& written) {
    if (!written && !trouble_) trouble_ = written.error();
  }
  void add_loss(const McapLoss& loss) {
    done_.loss.chunks += loss.chunks;
    done_.loss.messages += loss.messages;
    done_.loss.bytes += loss.bytes;
    for (const McapTrouble& trouble : loss.first_troubles) done_.loss.note(trouble.offset, trouble.error);
    done_.loss.troubles += loss.troubles - loss.first_troubles.size();
  }

  const Recording& recording_;
  const RecordedRange range_;
  const uint64_t start_ns_, end_ns_;
  McapWriter writer_;
  bool snapshot_next_;  // the next tick is a snapshot
  Place place_ = Place::kBefore;
  std::optional<uint64_t> lead_ns_;  // log time of the lead's first message
  bool leads_from_start_ = false;    // the lead begins with the session
  SessionSnapshot snapshot_;
  v1::Gap lost_;  // before the range
  uint16_t tick_channel_id_ = 0;
  std::array<std::optional<KeptMessage>, kRecordTopics> kept_{};  // in the order of a head
  std::vector<KeptMessage> level_;                                // of the viewers' topic kLevel
  std::map<uint16_t, uint16_t> schemas_, channels_;               // the cut's ids by the recording's
  std::optional<Error> trouble_;
  RecordingCut done_;
};

}  // namespace

Result<RecordingCut> cut_recording(const Recording& recording, const RecordedRange& range, ByteSink& sink) {
  return Cutter(recording, range, sink).run();
}

}  // namespace sightline
