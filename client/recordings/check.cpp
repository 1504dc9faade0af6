#include "client/recordings/check.h"

#include <algorithm>
#include <array>
#include <deque>
#include <functional>
#include <optional>

#include "client/recordings/summary.h"
#include "server/record/session_snapshot.h"

namespace sightline {
namespace {

constexpr size_t kMaxPending = 1 << 20;

std::string number(uint64_t value) {
  return std::to_string(value);
}

// True when the numbers of all topics begin at 1. A cut may begin anywhere, even when it has no snapshot tick because
// it begins before the first reply.
bool begins_with_session(const Recording& recording) {
  const auto& metadata = recording.container().metadata;
  const bool cut = std::any_of(metadata.begin(), metadata.end(),
                               [](const mcap::MetadataIndex& index) { return index.name == kCutMetadata; });
  return recording.info().part() <= 1 && recording.info().snapshot_ticks() == 0 && !cut;
}

class SessionCheck {
 public:
  explicit SessionCheck(const Recording& recording)
      : start_ns_(recording.start_ns()),
        from_start_(begins_with_session(recording)),
        snapshot_next_(recording.info().snapshot_ticks() > 0),
        in_head_(!from_start_),
        ticks_count_(from_start_) {}

  void take(const McapMessage& m) {
    const auto topic = record_topic_of(m.channel.topic);
    if (!topic) return;
    now_s_ = m.message.log_time_ns > start_ns_ ? static_cast<double>(m.message.log_time_ns - start_ns_) * 1e-9 : 0;
    count(*topic, m.message.sequence);
    if (*topic == RecordTopic::kTick) parsed<v1::Tick>(m, [this](const v1::Tick& tick) { take_tick(tick); });
    if (*topic == RecordTopic::kReply)
      parsed<v1::CameraReply>(m, [this](const v1::CameraReply& reply) { take_reply(reply); });
    if (*topic == RecordTopic::kTickError)
      parsed<v1::TickError>(m, [this](const v1::TickError& rejection) { take_rejection(rejection); });
    if (*topic == RecordTopic::kGap) parsed<v1::Gap>(m, [this](const v1::Gap& gap) { take_gap(gap); });
  }

  SessionVerdict finish() {
    if (verdict_.missing > told_missing_)
      note(number(verdict_.missing) + " messages are missing by their numbers, Gaps report " + number(told_missing_));
    if (verdict_.undecodable > 0)
      note(number(verdict_.undecodable) + " messages cannot be decoded as their topics require");
    return std::move(verdict_);
  }

 private:
  template <typename Message, typename Take>
  void parsed(const McapMessage& m, const Take& take) {
    Message message;
    if (message.ParseFromArray(m.message.data.data(), static_cast<int>(m.message.data.size())))
      take(message);
    else
      ++verdict_.undecodable;
  }

  // A part begins anywhere in the numbers of its topics. The messages of the head have no numbers of their own.
  void count(RecordTopic topic, uint32_t sequence) {
    if (topic <= RecordTopic::kOpened || topic == RecordTopic::kGap) return;
    const bool counts = topic != RecordTopic::kTick || ticks_count_;
    note_place(topic);
    auto& last = last_number_[static_cast<size_t>(topic)];
    if (!last && from_start_) last = 0;
    if (counts && last && sequence > *last + uint64_t{1}) {
      verdict_.missing += sequence - *last - 1;
      unsure_ = true;
    }
    last = sequence;
  }

  // A head contains no replies, rejections or faults.
  void note_place(RecordTopic topic) {
    answered_ |= topic == RecordTopic::kReply || topic == RecordTopic::kTickError || topic == RecordTopic::kFault;
    in_head_ = in_head_ && !answered_;
    ticks_count_ |= topic == RecordTopic::kTick && !in_head_;
  }

  void take_tick(const v1::Tick& tick) {
    if (std::exchange(snapshot_next_, false)) {
      last_applied_ = tick.sequence();
      return;
    }
    pending_.push_back(tick.sequence());
    if (pending_.size() > kMaxPending) pending_.pop_front(), unsure_ = true;
  }

  void take_rejection(const v1::TickError& rejection) {
    ++verdict_.rejections;
    if (rejection.field_violations().empty()) return;
    const auto refused = find_refused(pending_, rejection, std::identity());
    if (refused != pending_.end())
      pending_.erase(refused);
    else if (!unsure_ && rejection.sequence() != 0)
      note("refuses tick " + number(rejection.sequence()) + ", which is not among the unanswered ticks");
  }

  // Before the first reply of a later part, only ticks can have been lost between numbered messages, and their numbers
  // do not count yet.
  void take_gap(const v1::Gap& gap) {
    verdict_.gap_messages += gap.messages();
    if (answered_ || ticks_count_) told_missing_ += gap.messages();
    unsure_ = true;
    // A Gap ends the head, unless it replaces a snapshot tick that was too large: the waiting ticks come after that
    // one.
    const bool for_fold = gap.reason() == v1::Gap::REASON_TOO_LARGE &&
                          !last_number_[static_cast<size_t>(RecordTopic::kTick)];
    in_head_ = in_head_ && for_fold;
  }

  void take_reply(const v1::CameraReply& reply) {
    ++verdict_.replies;
    for (const uint64_t tick : pending_) take_applied(tick);
    if (last_reply_ && reply.sequence() <= *last_reply_)
      note("reply to tick " + number(reply.sequence()) + " after one to tick " + number(*last_reply_));
    const uint64_t merged = pending_.empty() ? 0 : pending_.size() - 1;
    if (unsure_) {
      // Its tick may be among the missing ones.
    } else if (pending_.empty()) {
      note("reply to tick " + number(reply.sequence()) + ", and no tick since the former reply");
    } else if (pending_.back() != reply.sequence()) {
      note("reply to tick " + number(reply.sequence()) + ", but the newest is tick " + number(pending_.back()));
    } else if (reply.merged_ticks() != merged) {
      note("reply to tick " + number(reply.sequence()) + " says that it merged " + number(reply.merged_ticks()) +
           " ticks, the file has " + number(merged));
    }
    last_reply_ = reply.sequence();
    pending_.clear();
    unsure_ = false;
  }

  void take_applied(uint64_t tick) {
    ++verdict_.ticks;
    if (last_applied_ && tick <= *last_applied_)
      note("tick " + number(tick) + " was applied after tick " + number(*last_applied_));
    last_applied_ = tick;
  }

  void note(std::string text) {
    ++verdict_.troubles;
    if (verdict_.first_troubles.size() < SessionVerdict::kKeptTroubles)
      verdict_.first_troubles.push_back({now_s_, std::move(text)});
  }

  const uint64_t start_ns_;
  const bool from_start_;
  bool snapshot_next_;   // the next tick is a snapshot
  bool unsure_ = false;  // something is missing since the last reply
  // The head of a later part repeats the unanswered ticks. Refused ticks have numbers too, but stand only in the part
  // before. So numbers say nothing about missing ticks until the first tick that is certainly not a repeated one.
  bool in_head_;  // all messages so far may be repeated ones
  bool answered_ = false;
  bool ticks_count_;           // such a tick has come
  uint64_t told_missing_ = 0;  // messages that Gaps report as missing, where numbers count
  double now_s_ = 0.0;
  std::deque<uint64_t> pending_;  // ticks since the last reply, without refused ones
  std::optional<uint64_t> last_applied_, last_reply_;
  std::array<std::optional<uint64_t>, kRecordTopics> last_number_{};
  SessionVerdict verdict_;
};

}  // namespace

SessionVerdict check_session(const Recording& recording) {
  SessionCheck check(recording);
  recording.reader().read({}, [&](const McapMessage& m) {
    check.take(m);
    return true;
  });
  return check.finish();
}

}  // namespace sightline
