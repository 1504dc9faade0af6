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
// one message. Bytes are those in memory: two bytes on the wire can be an empty message of a hundred.
class Inbox {
 public:
  struct Message {
    v1::ControlRequest request;
    int64_t arrival_ns = 0;
    size_t bytes = 0;
  };

  Inbox(size_t max_messages, size_t max_bytes) : max_messages_(max_messages), max_bytes_(max_bytes) {}

  bool empty() const { return messages_.empty(); }
  bool full() const { return messages_.size() >= max_messages_ || bytes_ >= max_bytes_; }

  void push(v1::ControlRequest request, int64_t arrival_ns) {
    const size_t bytes = request.SpaceUsedLong();
    bytes_ += bytes;
    messages_.push_back({std::move(request), arrival_ns, bytes});
  }

  // The oldest message; the inbox must not be empty.
  Message take_one() {
    Message message = std::move(messages_.front());
    messages_.pop_front();
    bytes_ -= message.bytes;
    return message;
  }

  // Gives back what was taken and could not be worked through yet; it is the oldest again. The bounds may be
  // passed by it once: they say when reading stops.
  void put_back(std::deque<Message> messages) {
    while (!messages.empty()) {
      bytes_ += messages.back().bytes;
      messages_.push_front(std::move(messages.back()));
      messages.pop_back();
    }
  }

  // Everything, oldest first.
  std::deque<Message> take_all() {
    bytes_ = 0;
    return std::exchange(messages_, {});
  }

 private:
  const size_t max_messages_;
  const size_t max_bytes_;
  std::deque<Message> messages_;
  size_t bytes_ = 0;
};

}  // namespace sightline
