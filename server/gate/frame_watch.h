// Watches what one client sends on an HTTP/2 connection, and says when the connection must be cut.
//
// gRPC 1.51 limits open calls and the size of messages, but not how fast calls are opened and reset, nor how long a header block
// is. Each reset call costs about 20 KB until the server has cleaned it up, so 7 MB of such frames take gigabytes. The
// watch reads only the nine bytes at the head of each frame and counts. It understands no headers and no messages.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string_view>

#include "server/base/token_bucket.h"

namespace sightline {

// A client of this service opens a call for each session, and a few more. These limits are far above that.
struct FrameLimits {
  // Calls that may begin at once, and how many more each second.
  double calls_burst = 1000.0, calls_per_s = 200.0;
  // The same for frames that cost work and carry nothing: RST_STREAM, SETTINGS, PRIORITY, empty DATA and empty CONTINUATION.
  double idle_frames_burst = 500.0, idle_frames_per_s = 100.0;
  // The same for PING. Clients measure their connection with it, some of them after each message.
  double pings_burst = 10'000.0, pings_per_s = 2'000.0;
  // The same for calls and for such frames on all connections of one client together. Behind one address there can be 200 connections, each
  // with some frames of this kind at its start and at its end.
  double client_burst = 2000.0, client_per_s = 400.0;
  // A connection that does no more than this is never cut for what its client does on others.
  double fair_burst = 64.0, fair_per_s = 4.0;
  // HEADERS with all its CONTINUATION frames. gRPC itself accepts 8 KiB of metadata.
  size_t max_header_block_bytes = 32 << 10;
  // A longer frame is an error in HTTP/2, unless the server asked for it, which gRPC does up to 4 MiB and a little.
  size_t max_frame_bytes = (4 << 20) + 1024;
};

// The rates of one client over all its connections. Thread-safe.
class ClientFlow {
 public:
  explicit ClientFlow(const FrameLimits& limits)
      : calls_(limits.client_burst, limits.client_per_s), idle_frames_(limits.client_burst, limits.client_per_s) {}
  // True when one more may pass.
  bool take_call(double now_s) { return take(calls_, now_s); }
  bool take_idle_frame(double now_s) { return take(idle_frames_, now_s); }
  // True when nothing has passed lately.
  bool full(double now_s) const {
    const std::lock_guard lock(mutex_);
    return calls_.full(now_s) && idle_frames_.full(now_s);
  }

 private:
  bool take(TokenBucket& bucket, double now_s) {
    const std::lock_guard lock(mutex_);
    return bucket.take(now_s);
  }

  mutable std::mutex mutex_;
  TokenBucket calls_, idle_frames_;  // guarded by mutex_
};

// Not thread-safe.
class FrameWatch {
 public:
  // Without a `client` only the connection's own limits hold.
  explicit FrameWatch(const FrameLimits& limits = {}, std::shared_ptr<ClientFlow> client = nullptr);

  // Takes the next bytes of the client. `now_s` is a monotonic time in seconds. Returns the reason to cut the connection, or
  // nothing. After a reason nothing may be given to it any more.
  std::optional<std::string_view> read(std::span<const std::byte> bytes, double now_s);

  // After a reason: the client sent too much. False: what it sent is no HTTP/2.
  bool flooded() const { return flooded_; }
  // The client has sent the preface of HTTP/2 and its first frame.
  bool greeted() const { return greeted_; }
  // Number of calls that the client has begun.
  uint64_t calls() const { return calls_; }
  // When it last sent a part of a call, on the clock of `read`; 0 before.
  double last_call_s() const { return last_call_s_; }

 private:
  std::optional<std::string_view> begin_frame(double now_s);
  std::optional<std::string_view> check_rates(bool call, bool idle, bool ping, double now_s);
  std::optional<std::string_view> check_header_block(size_t length, bool continued);

  const FrameLimits limits_;
  const std::shared_ptr<ClientFlow> client_;
  TokenBucket call_bucket_, idle_frame_bucket_, ping_bucket_;
  TokenBucket fair_calls_, fair_idle_frames_;
  std::array<std::byte, 9> head_{};  // of the next frame
  size_t head_size_ = 0;             // bytes of it that have come
  size_t preface_left_;              // bytes of the preface that are still to come
  size_t payload_left_ = 0;          // bytes of the frame that are still to come
  size_t header_block_bytes_ = 0;    // of the block that is not complete
  uint32_t newest_stream_ = 0;
  bool greeted_ = false, flooded_ = false;
  uint64_t calls_ = 0;
  double last_call_s_ = 0.0;
};

}  // namespace sightline
