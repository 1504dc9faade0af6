// Cuts the bytes of one direction of an HTTP/2 connection into frames (RFC 9113, section 4.1).
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace sightline {

// RFC 9113, section 6. Other numbers are legal, and their frames are ignored.
enum class FrameType : uint8_t {
  kData = 0,
  kHeaders = 1,
  kPriority = 2,
  kRstStream = 3,
  kSettings = 4,
  kPushPromise = 5,
  kPing = 6,
  kGoaway = 7,
  kWindowUpdate = 8,
  kContinuation = 9,
};

struct FrameHead {
  size_t length = 0;  // bytes of the payload
  FrameType type{};
  uint8_t flags = 0;
  uint32_t stream = 0;  // 0: the connection

  bool ends_stream() const { return (flags & 0x1u) != 0 && (type == FrameType::kData || type == FrameType::kHeaders); }
  bool ends_headers() const { return (flags & 0x4u) != 0; }
  bool padded() const { return (flags & 0x8u) != 0; }
  bool acknowledges() const {
    return (flags & 0x1u) != 0 && (type == FrameType::kPing || type == FrameType::kSettings);
  }
};

// Not thread-safe.
class FrameReader {
 public:
  // Gives `visitor` the frames in these bytes, however they are cut: `begin(head)`, `payload(part)` for each part of
  // the payload, and `end()`. `begin` and `end` return true to go on. Returns the number of bytes that were read.
  template <typename Visitor>
  size_t read(std::span<const std::byte> bytes, Visitor& visitor) {
    size_t at = 0;
    while (at < bytes.size()) {
      const std::span<const std::byte> rest = bytes.subspan(at);
      const size_t taken = in_payload_ ? take_payload(rest) : take_head(rest);
      at += taken;
      if (in_payload_) {
        visitor.payload(rest.first(taken));
      } else {
        if (head_size_ < bytes_of_head_.size()) continue;
        head_size_ = 0;
        head_ = parsed_head();
        left_ = head_.length;
        in_payload_ = true;
        if (!visitor.begin(head_)) return at;
      }
      if (left_ > 0) continue;
      in_payload_ = false;
      if (!visitor.end()) return at;
    }
    return at;
  }

  // The frame that was begun last.
  const FrameHead& head() const { return head_; }

 private:
  size_t take_payload(std::span<const std::byte> bytes) {
    const size_t taken = std::min(left_, bytes.size());
    left_ -= taken;
    return taken;
  }
  size_t take_head(std::span<const std::byte> bytes) {
    const size_t taken = std::min(bytes_of_head_.size() - head_size_, bytes.size());
    std::copy_n(bytes.begin(), taken, bytes_of_head_.begin() + static_cast<ptrdiff_t>(head_size_));
    head_size_ += taken;
    return taken;
  }
  FrameHead parsed_head() const {
    const auto byte = [&](size_t i) { return static_cast<uint32_t>(bytes_of_head_[i]); };
    return {.length = byte(0) << 16 | byte(1) << 8 | byte(2),
            .type = static_cast<FrameType>(byte(3)),
            .flags = static_cast<uint8_t>(byte(4)),
            .stream = (byte(5) & 0x7Fu) << 24 | byte(6) << 16 | byte(7) << 8 | byte(8)};
  }

  std::array<std::byte, 9> bytes_of_head_{};
  size_t head_size_ = 0;  // bytes of the next head that have come
  FrameHead head_;
  size_t left_ = 0;  // bytes of the payload that are still to come
  bool in_payload_ = false;
};

}  // namespace sightline
