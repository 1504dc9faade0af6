// What gRPC may hold of the messages that a client sent on one stream.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace sightline {

// Follows the messages of gRPC in the DATA frames of a stream: each has a flag and its length before it. It reads
// nothing else of them. Not thread-safe.
class StreamMessages {
 public:
  // Beside the payload, each frame takes its head, which stays in memory with it, and an entry in gRPC's list of
  // slices.
  static constexpr size_t kBytesOfFrame = 9 + 32;

  void begin_frame() { ++frames_, ++unfinished_frames_; }
  // Returns the number of messages that these bytes complete.
  size_t take(std::span<const std::byte> payload) {
    received_ += payload.size();
    size_t completed = 0;
    while (!payload.empty()) {
      const size_t taken = after_prefix() ? take_body(payload.size()) : take_prefix(payload);
      unfinished_ += taken;
      payload = payload.subspan(taken);
      if (!after_prefix() || left_ > 0) continue;
      ++completed;
      unfinished_ = prefix_size_ = 0;
      unfinished_frames_ = 0;
    }
    if (held_payload() == 0) frames_ = 0;
    return completed;
  }
  // The server has taken so many bytes from the stream, or is ready to take so many more of a message that it waits
  // for.
  void grant(uint32_t bytes) {
    const uint64_t before = unread();
    granted_ += bytes;
    // What is left has its part of the frames.
    if (before > 0) frames_ = std::max(unfinished_frames_, frames_ * unread() / before);
    if (held_payload() == 0) frames_ = 0;
  }

  // An upper estimate, in bytes. A message that is not complete is held as a whole; complete ones until the server lets
  // the client send on.
  size_t held_bytes() const {
    const uint64_t payload = held_payload();
    return payload > 0 ? payload + frames_ * kBytesOfFrame : 0;
  }

 private:
  uint64_t unread() const { return received_ > granted_ ? received_ - granted_ : 0; }
  uint64_t held_payload() const { return std::max(unfinished_, unread()); }
  bool after_prefix() const { return prefix_size_ == prefix_.size(); }
  size_t take_prefix(std::span<const std::byte> payload) {
    const size_t taken = std::min(prefix_.size() - prefix_size_, payload.size());
    std::copy_n(payload.begin(), taken, prefix_.begin() + static_cast<ptrdiff_t>(prefix_size_));
    prefix_size_ += taken;
    left_ = 0;
    for (size_t i = 1; i < prefix_.size(); ++i) left_ = left_ << 8 | static_cast<uint32_t>(prefix_[i]);
    return taken;
  }
  size_t take_body(size_t size) {
    const auto taken = static_cast<uint32_t>(std::min<size_t>(left_, size));
    left_ -= taken;
    return taken;
  }

  std::array<std::byte, 5> prefix_{};
  size_t prefix_size_ = 0;   // bytes of it that have come
  uint32_t left_ = 0;        // bytes of the message that are still to come, after its prefix
  uint64_t unfinished_ = 0;  // bytes of a message that is not complete, its prefix included
  uint64_t received_ = 0, granted_ = 0;
  uint64_t frames_ = 0;             // of what is held
  uint64_t unfinished_frames_ = 0;  // of the message that is not complete
};

}  // namespace sightline
