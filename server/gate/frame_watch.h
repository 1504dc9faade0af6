// Watches what one client sends on an HTTP/2 connection, and says when the connection must be cut.
//
// gRPC 1.51 limits open calls and the size of messages, but not how fast calls are opened and reset, nor how long a header block
// is. Each reset call costs about 20 KB until the server has cleaned it up, so 7 MB of such frames take gigabytes. The
// watch reads only the nine bytes at the head of each frame and counts. It understands no headers and no messages.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
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
  // HEADERS with all its CONTINUATION frames. gRPC itself accepts 8 KiB of metadata.
  size_t max_header_block_bytes = 32 << 10;
  // A longer frame is an error in HTTP/2, unless the server asked for it, which gRPC does up to 4 MiB and a little.
  size_t max_frame_bytes = (4 << 20) + 1024;
};

// Not thread-safe.
class FrameWatch {
 public:
  explicit FrameWatch(const FrameLimits& limits = {});

  // Takes the next bytes of the client. `now_s` is a monotonic time in seconds. Returns the reason to cut the connection, or
  // nothing. After a reason nothing may be given to it any more.
  std::optional<std::string_view> read(std::span<const std::byte> bytes, double now_s);

  // The client has sent the preface of HTTP/2 and its first frame.
  bool greeted() const { return greeted_; }
  // Number of calls that the client has begun.
  uint64_t calls() const { return calls_; }
  // When it last sent a part of a call, on the clock of `read`; 0 before.
  double last_call_s() const { return last_call_s_; }

 private:
  std::optional<std::string_view> begin_frame(double now_s);
  std::optional<std::string_view> check_header_block(size_t length, bool continued);

  const FrameLimits limits_;
  TokenBucket call_bucket_, idle_frame_bucket_, ping_bucket_;
  std::array<std::byte, 9> head_{};  // of the next frame
  size_t head_size_ = 0;             // bytes of it that have come
  size_t preface_left_;              // bytes of the preface that are still to come
  size_t payload_left_ = 0;          // bytes of the frame that are still to come
  size_t header_block_bytes_ = 0;    // of the block that is not complete
  uint32_t newest_stream_ = 0;
  bool greeted_ = false;
  uint64_t calls_ = 0;
  double last_call_s_ = 0.0;
};

}  // namespace sightline
