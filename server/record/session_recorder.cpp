// The session's half of the recorder: it puts messages into a queue and never waits.
#include <google/protobuf/message_lite.h>

#include <algorithm>
#include <cassert>

#include "server/record/record_session.h"

namespace sightline {

using record_internal::add_to_gap;
using record_internal::Attached;
using record_internal::Session;

SessionRecorder::SessionRecorder(std::shared_ptr<Session> session) : session_(std::move(session)) {}

SessionRecorder::~SessionRecorder() {
  session_->closed.store(true, std::memory_order_release);
}

bool SessionRecorder::record(RecordTopic topic, RecordTimes times, const google::protobuf::MessageLite& message) {
  const size_t size = message.ByteSizeLong();
  if (size > session_->max_in_ring()) return record_beside(topic, times, message.SerializeAsString());
  char* at = reserve(topic, times, size);
  if (at == nullptr) return false;
  message.SerializeWithCachedSizesToArray(reinterpret_cast<uint8_t*>(at));
  commit(topic, times, size);
  return true;
}

bool SessionRecorder::record(RecordTopic topic, RecordTimes times, std::string_view serialised) {
  if (serialised.size() > session_->max_in_ring()) return record_beside(topic, times, std::string(serialised));
  char* at = reserve(topic, times, serialised.size());
  if (at == nullptr) return false;
  std::copy(serialised.begin(), serialised.end(), at);
  commit(topic, times, serialised.size());
  return true;
}

char* SessionRecorder::reserve(RecordTopic topic, RecordTimes times, size_t size) {
  assert(topic <= RecordTopic::kMemory);
  // A dropped message uses up its number, so that the gap is visible.
  ++sequences_[static_cast<size_t>(topic)];
  char* at = nullptr;
  if (gap_.messages() == 0 || record_gap(times)) at = session_->ring.reserve(size);
  if (at == nullptr) drop(times, v1::Gap::REASON_QUEUE_FULL);
  return at;
}

bool SessionRecorder::record_beside(RecordTopic topic, RecordTimes times, std::string serialised) {
  if (reserve(topic, times, 0) == nullptr) return false;
  // Without commit() the entry does not exist.
  const bool too_large = serialised.size() > session_->max_message_bytes;
  if (too_large || !session_->large.put(std::move(serialised))) {
    drop(times, too_large ? v1::Gap::REASON_TOO_LARGE : v1::Gap::REASON_QUEUE_FULL);
    return false;
  }
  commit(topic, times, 0, true);
  return true;
}

void SessionRecorder::commit(RecordTopic topic, RecordTimes times, size_t size, bool beside) {
  newest_ns_ = std::max(times.log_ns, newest_ns_ + 1);
  session_->ring.commit({static_cast<uint32_t>(size), static_cast<uint16_t>(topic), beside,
                         sequences_[static_cast<size_t>(topic)], 0, newest_ns_, times.publish_ns});
  if (session_->ring.half_full() || topic == RecordTopic::kOpened) session_->waker->wake();
}

// A Gap is written before the message that follows the loss. It is only written when there is room for that message
// too; otherwise a full queue would fill with Gaps.
bool SessionRecorder::record_gap(RecordTimes times) {
  if (session_->ring.half_full()) return false;
  const size_t size = gap_.ByteSizeLong();
  char* at = session_->ring.reserve(size);
  if (at == nullptr) return false;
  gap_.SerializeWithCachedSizesToArray(reinterpret_cast<uint8_t*>(at));
  ++sequences_[static_cast<size_t>(RecordTopic::kGap)];
  commit(RecordTopic::kGap, times, size);
  gap_.Clear();
  return true;
}

void SessionRecorder::drop(RecordTimes times, v1::Gap::Reason reason) {
  add_to_gap(gap_, reason, 1, times.log_ns, times.log_ns);
  auto& dropped = reason == v1::Gap::REASON_TOO_LARGE ? session_->dropped_too_large : session_->dropped_queue_full;
  dropped.fetch_add(1, std::memory_order_relaxed);
}

bool SessionRecorder::attach(std::string name, std::string content_type, uint64_t log_time_ns,
                             std::shared_ptr<const std::string> data) {
  auto attached = std::make_shared<Attached>();
  attached->head = {log_time_ns, log_time_ns, std::move(name), std::move(content_type), *data, 0};
  attached->data = std::move(data);
  return session_->attached.add(std::move(attached));
}

std::string SessionRecorder::file_name() const {
  return recording_name(session_->info.start_time_ns(), session_->info.session_id(), 1);
}

void SessionRecorder::show_level(std::shared_ptr<const LevelView> level) {
  session_->level = std::move(level);
}

bool SessionRecorder::wants_memory() const {
  return session_->wants_memory.load(std::memory_order_relaxed);
}

bool SessionRecorder::degraded() const {
  return gap_.messages() > 0 || session_->failing.load(std::memory_order_relaxed);
}

uint64_t SessionRecorder::dropped() const {
  return session_->dropped_queue_full.load(std::memory_order_relaxed) +
         session_->dropped_too_large.load(std::memory_order_relaxed) +
         session_->dropped_by_writer.load(std::memory_order_relaxed);
}

}  // namespace sightline
