// The messages of one client that wait to be worked through.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <utility>

#include "server/service/message_memory.h"
#include "sightline/v1/camera_control.pb.h"

namespace sightline {

// The number of messages and their bytes are bounded. A full inbox refuses nothing: its owner stops reading, and gRPC's
// flow control stops the client. It holds at most `max_messages`, and at most `max_bytes` plus one message.
//
// Bytes are counted in memory, because two bytes on the wire can become an empty message of a hundred. The exact size
// needs a walk by reflection, which takes 15 us when the caches are cold. A tick that is small on the wire therefore
// counts as the largest size that it can have in memory.
class Inbox {
 public:
  static constexpr size_t kSmallTick = 1024;       // bytes on the wire
  static constexpr size_t kMostOfEmptyTick = 512;  // bytes in memory of an empty tick, at most
  static constexpr size_t kMostByByte = 72;        // further bytes in memory for each byte on the wire, at most

  struct Message {
    v1::ControlRequest request;
    int64_t arrival_ns = 0;
    size_t bytes = 0;
  };

  // The messages also count in the share of the stream's client; null: in none.
  Inbox(size_t max_messages, size_t max_bytes, std::shared_ptr<MessageMemory::Share> share = nullptr)
      : max_messages_(max_messages), max_bytes_(max_bytes), share_(std::move(share)) {}
  ~Inbox() { clear(); }
  Inbox(const Inbox&) = delete;
  Inbox& operator=(const Inbox&) = delete;

  bool empty() const { return messages_.empty(); }
  // An inbox with a message is also full when those of all streams take too much memory. An empty one never is, so
  // every stream goes on.
  bool full() const {
    return messages_.size() >= max_messages_ || bytes_ >= max_bytes_ || (share_ && !empty() && share_->all_over());
  }

  void push(v1::ControlRequest request, int64_t arrival_ns) {
    const size_t bytes = bytes_of(request);
    messages_.push_back({std::move(request), arrival_ns, bytes});
    grow(bytes);
  }

  // The size that a message counts as.
  static size_t bytes_of(const v1::ControlRequest& request) {
    if (request.has_tick())
      if (const size_t wire = request.ByteSizeLong(); wire <= kSmallTick) return kMostOfEmptyTick + kMostByByte * wire;
    return request.SpaceUsedLong();
  }

  // The oldest message; the inbox must not be empty.
  Message take_one() {
    Message message = std::move(messages_.front());
    messages_.pop_front();
    shrink(message.bytes);
    return message;
  }

  // Puts messages back that could not be worked through yet, before all others, and empties `messages`. This may exceed
  // the bounds, which only say when reading stops.
  void put_back(std::deque<Message>& messages) {
    while (!messages.empty()) {
      grow(messages.back().bytes);
      messages_.push_front(std::move(messages.back()));
      messages.pop_back();
    }
  }

  // Moves everything, oldest first, into `messages`, which must be empty. The two swap their memory, so nothing is
  // allocated.
  void take_all(std::deque<Message>& messages) {
    shrink(bytes_);
    messages_.swap(messages);
  }

  void clear() {
    shrink(bytes_);
    messages_.clear();
  }

 private:
  void grow(size_t bytes) {
    bytes_ += bytes;
    if (share_) share_->add(bytes);
  }
  void shrink(size_t bytes) {
    bytes_ -= bytes;
    if (share_) share_->remove(bytes);
  }

  const size_t max_messages_;
  const size_t max_bytes_;
  const std::shared_ptr<MessageMemory::Share> share_;
  std::deque<Message> messages_;
  size_t bytes_ = 0;
};

}  // namespace sightline
