// The data that the two ends of a recorded session share: the session's end (session_recorder.cpp) and the writer's end
// (recorder.cpp). Internal to these two files; others use server/record/recorder.h.
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <deque>
#include <memory>
#include <string>
#include <vector>

#include "server/base/mutex.h"
#include "server/record/recorder.h"

namespace sightline::record_internal {

struct Attached {
  mcap::Attachment head;  // its data are those below
  std::shared_ptr<const std::string> data;
};

// Messages that are too large for the ring, in the order of their entries in it.
class LargeMessages {
 public:
  bool put(std::string message) {
    const MutexLock lock(mutex_);
    if (bytes_ + message.size() > kMaxMessageBytes) return false;
    bytes_ += message.size();
    messages_.push_back(std::move(message));
    return true;
  }
  std::string take() {
    const MutexLock lock(mutex_);
    std::string message = std::move(messages_.front());
    messages_.pop_front();
    bytes_ -= message.size();
    return message;
  }

 private:
  Mutex mutex_;
  std::deque<std::string> messages_ GUARDED(mutex_);
  uint64_t bytes_ GUARDED(mutex_) = 0;
};

// The files that a session attached. The list only grows.
class AttachedFiles {
 public:
  bool add(std::shared_ptr<const Attached> file) {
    const MutexLock lock(mutex_);
    const uint64_t bytes = bytes_.load(std::memory_order_relaxed) + file->data->size();
    if (files_.size() >= SessionRecorder::kMaxAttachments || bytes > kMaxAttachmentBytes) return false;
    files_.push_back(std::move(file));
    bytes_.store(bytes, std::memory_order_relaxed);
    count_.store(files_.size(), std::memory_order_release);
    return true;
  }
  size_t count() const { return count_.load(std::memory_order_acquire); }
  uint64_t bytes() const { return bytes_.load(std::memory_order_relaxed); }
  std::shared_ptr<const Attached> at(size_t index) const {
    const MutexLock lock(mutex_);
    return files_[index];
  }

 private:
  mutable Mutex mutex_;
  std::vector<std::shared_ptr<const Attached>> files_ GUARDED(mutex_);
  // written under mutex_, read without it
  std::atomic<size_t> count_{0};
  std::atomic<uint64_t> bytes_{0};
};

// Wakes the writer before its period ends.
struct Waker {
  // Never waits. A call just before the writer goes to sleep takes effect at the end of the writer's period.
  void wake() {
    if (!called.load(std::memory_order_relaxed) && !called.exchange(true)) condition.notify_one();
  }
  void wake_surely() {
    const MutexLock lock(mutex);
    called.store(true);
    condition.notify_one();
  }
  void wait(std::chrono::nanoseconds timeout) {
    MutexLock lock(mutex);
    condition.wait_for(lock, timeout, [this] { return called.load(); });
    called.store(false);
  }

  std::atomic<bool> called{false};
  Mutex mutex;
  ConditionVariable condition;
};

// One session.
struct Session {
  Session(v1::RecordingInfo recording_info, const RecordSettings& settings, std::shared_ptr<Waker> of_writer)
      : info(std::move(recording_info)),
        max_message_bytes(settings.max_message_bytes),
        ring(settings.queue_bytes),
        waker(std::move(of_writer)) {}
  // Larger messages go to `large`, or are refused there.
  size_t max_in_ring() const { return std::min<size_t>(ring.max_message(), max_message_bytes); }

  // constant after construction
  v1::RecordingInfo info;
  const uint64_t max_message_bytes;

  // Set before the first message is recorded; null: not known.
  std::shared_ptr<const LevelView> level;

  RecordRing ring;
  std::atomic<bool> closed{false};        // set by the recorder: nothing more comes
  std::atomic<bool> failing{false};       // set by the writer: there is no file
  std::atomic<bool> wants_memory{false};  // set by the writer: the file is nearly full, or began without a memory
  // Counted by the recorder: the queue was full, or the message too large.
  std::atomic<uint64_t> dropped_queue_full{0};
  std::atomic<uint64_t> dropped_too_large{0};
  std::atomic<uint64_t> dropped_by_writer{0};
  LargeMessages large;
  AttachedFiles attached;
  const std::shared_ptr<Waker> waker;

  // Used by the writer only, for the file that it writes:
  size_t attachments_done = 0;    // files of `attached` bytes of attachments in it, or will not be
  uint64_t attachment_bytes = 0;  // that are in it
};

// Adds lost messages to a gap. The first ones added give the gap its reason and its beginning.
inline void add_to_gap(v1::Gap& gap, v1::Gap::Reason reason, uint64_t messages, uint64_t first_ns, uint64_t last_ns) {
  if (gap.messages() == 0) {
    gap.set_first_time_ns(first_ns);
    gap.set_reason(reason);
  }
  gap.set_last_time_ns(last_ns);
  gap.set_messages(gap.messages() + messages);
}

}  // namespace sightline::record_internal
