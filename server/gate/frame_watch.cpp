#include "server/gate/frame_watch.h"

#include <algorithm>
#include <utility>

namespace sightline {
namespace {

constexpr std::string_view kPreface = "PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n";

// RFC 9113, section 6.
enum FrameType : uint8_t {
  kData = 0,
  kHeaders = 1,
  kPriority = 2,
  kRstStream = 3,
  kSettings = 4,
  kPing = 6,
  kContinuation = 9,
};

}  // namespace

FrameWatch::FrameWatch(const FrameLimits& limits, std::shared_ptr<ClientFlow> client)
    : limits_(limits),
      client_(std::move(client)),
      call_bucket_(limits.calls_burst, limits.calls_per_s),
      idle_frame_bucket_(limits.idle_frames_burst, limits.idle_frames_per_s),
      ping_bucket_(limits.pings_burst, limits.pings_per_s),
      fair_calls_(limits.fair_burst, limits.fair_per_s),
      fair_idle_frames_(limits.fair_burst, limits.fair_per_s),
      preface_left_(kPreface.size()) {}

std::optional<std::string_view> FrameWatch::read(std::span<const std::byte> bytes, double now_s) {
  while (!bytes.empty()) {
    if (preface_left_ > 0) {
      if (static_cast<char>(bytes[0]) != kPreface[kPreface.size() - preface_left_]) return "it does not speak HTTP/2";
      --preface_left_;
      bytes = bytes.subspan(1);
    } else if (payload_left_ > 0) {
      const size_t part = std::min(payload_left_, bytes.size());
      payload_left_ -= part;
      bytes = bytes.subspan(part);
    } else {
      head_[head_size_++] = bytes[0];
      bytes = bytes.subspan(1);
      if (head_size_ < head_.size()) continue;
      head_size_ = 0;
      if (const auto reason = begin_frame(now_s)) return reason;
    }
  }
  return {};
}

std::optional<std::string_view> FrameWatch::begin_frame(double now_s) {
  const auto byte = [&](size_t i) { return static_cast<uint32_t>(head_[i]); };
  const size_t length = byte(0) << 16 | byte(1) << 8 | byte(2);
  const uint32_t stream = (byte(5) & 0x7Fu) << 24 | byte(6) << 16 | byte(7) << 8 | byte(8);
  const auto type = static_cast<FrameType>(byte(3));
  const bool ends_headers = (byte(4) & 0x4u) != 0;
  if (length > limits_.max_frame_bytes) return "a frame is too long";
  payload_left_ = length;
  greeted_ = true;

  const bool headers = type == kHeaders || type == kContinuation;
  if (headers) {
    if (const auto reason = check_header_block(length, type == kContinuation)) return reason;
    if (ends_headers) header_block_bytes_ = 0;
  }
  const bool call = type == kHeaders && stream > newest_stream_;
  if (call) {
    newest_stream_ = stream;
    ++calls_;
  }
  if (headers || type == kData) last_call_s_ = now_s;
  const bool empty = length == 0 && (type == kData || type == kContinuation) && (byte(4) & 0x1u) == 0;
  const bool idle = empty || type == kPriority || type == kRstStream || type == kSettings;
  const auto reason = check_rates(call, idle, type == kPing, now_s);
  flooded_ = reason.has_value();
  return reason;
}

// All buckets are asked, so that each knows what passed.
std::optional<std::string_view> FrameWatch::check_rates(bool call, bool idle, bool ping, double now_s) {
  if (call) {
    const bool fair = fair_calls_.take(now_s), client = !client_ || client_->take_call(now_s);
    if (!call_bucket_.take(now_s)) return "it opens calls too fast";
    if (!client && !fair) return "its client opens calls too fast on all connections together";
  }
  if (idle) {
    const bool fair = fair_idle_frames_.take(now_s), client = !client_ || client_->take_idle_frame(now_s);
    if (!idle_frame_bucket_.take(now_s)) return "it resets calls, or sends frames that carry nothing, too fast";
    if (!client && !fair) return "its client resets calls, or sends frames that carry nothing, too fast on all connections together";
  }
  if (ping && !ping_bucket_.take(now_s)) return "it sends pings too fast";
  return {};
}

std::optional<std::string_view> FrameWatch::check_header_block(size_t length, bool continued) {
  header_block_bytes_ = continued ? header_block_bytes_ + length : length;
  flooded_ = header_block_bytes_ > limits_.max_header_block_bytes;
  if (flooded_) return "the headers of a call are too long";
  return {};
}

}  // namespace sightline
