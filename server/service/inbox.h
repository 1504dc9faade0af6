// What a client has sent and no worker has taken yet.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <utility>

#include "sightline/v1/camera_control.pb.h"

namespace sightline {

// A bound on messages and one on their bytes. A full inbox refuses nothing: its owner stops reading, and the
// transport's flow control stops the client. So it holds at most `max_messages`, and at most `max_bytes` plus
// one message. Bytes are those in memory: two bytes on the wire can be an empty message of a hundred. To add them up takes a walk
// by reflection, 15 us after a rest, so a tick that is small on the wire counts for the most that one of its size can take.
class Inbox {
 public:
  static constexpr size_t kSmallTick = 1024;                         // bytes on the wire
  static constexpr size_t kMostOfEmptyTick = 512, kMostByByte = 72;  // bytes in memory, and more for each byte on the wire

  struct Message {
    v1::ControlRequest request;
    int64_t arrival_ns = 0;
    size_t bytes = 0;
  };

  Inbox(size_t max_messages, size_t max_bytes) : max_messages_(max_messages), max_bytes_(max_bytes) {}

  bool empty() const { return messages_.empty(); }
  bool full() const { return messages_.size() >= max_messages_ || bytes_ >= max_bytes_; }

  void push(v1::ControlRequest request, int64_t arrival_ns) {
    const size_t bytes = bytes_of(request);
    bytes_ += bytes;
    messages_.push_back({std::move(request), arrival_ns, bytes});
  }

  // What a message counts for.
  static size_t bytes_of(const v1::ControlRequest& request) {
    if (request.has_tick())
      if (const size_t wire = request.ByteSizeLong(); wire <= kSmallTick) return kMostOfEmptyTick + kMostByByte * wire;
    return request.SpaceUsedLong();
  }

  // The oldest message; the inbox must not be empty.
  Message take_one() {
    Message message = std::move(messages_.front());
    messages_.pop_front();
    bytes_ -= message.bytes;
    return message;
  }

  // Gives back what was taken and could not be worked through yet; it is the oldest again. The bounds may be
  // passed by it once: they say when reading stops. None is left in `messages`.
  void put_back(std::deque<Message>& messages) {
    while (!messages.empty()) {
      bytes_ += messages.back().bytes;
      messages_.push_front(std::move(messages.back()));
      messages.pop_back();
    }
  }

  // Everything, oldest first, into `messages`, which must be empty. The two change their memory, so that none is asked for.
  void take_all(std::deque<Message>& messages) {
    bytes_ = 0;
    messages_.swap(messages);
  }

  void clear() {
    bytes_ = 0;
    messages_.clear();
  }

 private:
  const size_t max_messages_;
  const size_t max_bytes_;
  std::deque<Message> messages_;
  size_t bytes_ = 0;
};

}  // namespace sightline
