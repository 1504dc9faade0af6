// What the two ends of a recorded session share: the one that a session has (session_recorder.cpp) and the one that
// writes (recorder.cpp). For these two alone; server/record/recorder.h is what others use.
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "server/record/recorder.h"

namespace sightline::record_internal {

struct Attached {
  mcap::Attachment head;  // its data are those below
  std::shared_ptr<const std::string> data;
};

// Messages that the ring has no room for, in the order of their entries in it.
class LargeMessages {
 public:
  bool put(std::string message) {
    const std::lock_guard lock(mutex_);
    if (bytes_ + message.size() > kMaxMessageBytes) return false;
    bytes_ += message.size();
    messages_.push_back(std::move(message));
    return true;
  }
  std::string take() {
    const std::lock_guard lock(mutex_);
    std::string message = std::move(messages_.front());
    messages_.pop_front();
    bytes_ -= message.size();
    return message;
  }

 private:
  std::mutex mutex_;
  // guarded by mutex_
  std::deque<std::string> messages_;
  uint64_t bytes_ = 0;
};

// What a session asked to be attached. It only grows.
class AttachedFiles {
 public:
  bool add(std::shared_ptr<const Attached> file) {
    const std::lock_guard lock(mutex_);
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
    const std::lock_guard lock(mutex_);
    return files_[index];
  }

 private:
  mutable std::mutex mutex_;
  std::vector<std::shared_ptr<const Attached>> files_;  // guarded by mutex_
  // Written under it, read without.
  std::atomic<size_t> count_{0};
  std::atomic<uint64_t> bytes_{0};
};

// Calls the writer before its time.
struct Bell {
  // Waits for nobody: one that comes as the writer is about to sleep is heard at the end of its period.
  void ring() {
    if (!rung.load(std::memory_order_relaxed) && !rung.exchange(true)) heard.notify_one();
  }
  void ring_surely() {
    const std::lock_guard lock(mutex);
    rung.store(true);
    heard.notify_one();
  }
  void wait(std::chrono::nanoseconds timeout) {
    std::unique_lock lock(mutex);
    heard.wait_for(lock, timeout, [this] { return rung.load(); });
    rung.store(false);
  }

  std::atomic<bool> rung{false};
  std::mutex mutex;
  std::condition_variable heard;
};

// What both ends share.
struct Session {
  Session(v1::RecordingInfo told, const RecordSettings& settings, std::shared_ptr<Bell> of_writer)
      : info(std::move(told)),
        max_message_bytes(settings.max_message_bytes),
        ring(settings.queue_bytes),
        bell(std::move(of_writer)) {}
  // What is larger goes beside the ring, or is refused there.
  size_t max_in_ring() const { return std::min<size_t>(ring.max_message(), max_message_bytes); }

  // constant after construction
  v1::RecordingInfo info;
  const uint64_t max_message_bytes;

  RecordRing ring;
  std::atomic<bool> closed{false};   // by the recorder: nothing more comes
  std::atomic<bool> failing{false};  // by the writer: there is no file
  // By the recorder, for want of room in the queue and for their size.
  std::atomic<uint64_t> dropped_queue_full{0};
  std::atomic<uint64_t> dropped_too_large{0};
  std::atomic<uint64_t> dropped_by_writer{0};
  LargeMessages large;
  AttachedFiles attached;
  const std::shared_ptr<Bell> bell;

  // The writer's alone, of the file that it writes:
  size_t attachments_done = 0;    // of `attached`, that are in it or are not to be
  uint64_t attachment_bytes = 0;  // that are in it
};

// A gap without messages says nothing: the first that are added give it its reason and where it begins.
inline void add_to_gap(v1::Gap& gap, v1::Gap::Reason reason, uint64_t messages, uint64_t first_ns,
                       uint64_t last_ns) {
  if (gap.messages() == 0) {
    gap.set_first_time_ns(first_ns);
    gap.set_reason(reason);
  }
  gap.set_last_time_ns(last_ns);
  gap.set_messages(gap.messages() + messages);
}

}  // namespace sightline::record_internal
