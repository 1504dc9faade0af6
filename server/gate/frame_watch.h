// Watches what one client sends on an HTTP/2 connection, and says when the connection must be cut.
//
// gRPC 1.51 limits open calls and the size of messages, but not how fast calls are opened and reset, how long a header
// block is, or how many frames come that carry nothing. Each reset call costs about 20 KB until the server has cleaned
// it up, and each frame takes processor time, whatever its type. So the watch counts every frame by what it costs and
// by what it carries, without a list of bad types. It reads the nine bytes at the head of each frame and the length
// before each message; it understands no headers and no messages.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <unordered_map>

#include "server/base/mutex.h"
#include "server/base/token_bucket.h"
#include "server/gate/frame_reader.h"
#include "server/gate/stream_messages.h"

namespace sightline {

// A client of this service opens a call for each session, and a few more. These limits are far above that.
struct FrameLimits {
  // Calls that may begin at once, and how many more each second.
  double calls_burst = 1000.0, calls_per_s = 200.0;
  // Calls that one relay lets begin at once, and how many more each second, of all clients together. Others wait for
  // their turn. gRPC reads all fields of a call's headers before it refuses them, and a field can have five bytes. So
  // each `bytes_of_paced` bytes of headers after the first count as a call more.
  double paced_burst = 32.0, paced_per_s = 2000.0;
  double bytes_of_paced = 512.0;
  // Overhead that may come at once, and how much more each second. A frame is an overhead of 1, and of 1 more for each
  // 512 bytes that belong to no message. A frame of data is none if it completes a message or ends a call, and
  // otherwise less, the more it carries. Each call that begins, and each frame of the server that a client may answer,
  // makes room for some.
  double overhead_burst = 500.0, overhead_per_s = 100.0;
  double bytes_of_overhead = 512.0;
  double for_call = 2.0, for_kib = 1.0, for_answer = 3.0;
  // Frames of a call that are still under way when the server ends the call. They count as if it were open.
  int frames_after_end = 128;
  // The same for calls and for overhead on all connections of one client together. Behind one address there can be 200
  // connections, each with some overhead at its start and at its end.
  double client_burst = 2000.0, client_per_s = 400.0;
  // A connection that does no more than this is never cut for what its client does on others.
  double fair_burst = 64.0, fair_per_s = 4.0;
  // HEADERS with all its CONTINUATION frames. gRPC itself accepts 8 KiB of metadata.
  size_t max_header_block_bytes = 32 << 10;
  // A longer frame is an error in HTTP/2, unless the server asked for it, which gRPC does up to 4 MiB and a little.
  size_t max_frame_bytes = (4 << 20) + 1024;
  // Calls that are open or have just ended. gRPC lets 1,024 be open; a client that has not heard of that yet may begin
  // more.
  size_t max_streams = 4096;
};

// What one client does on all its connections. Thread-safe.
class ClientFlow {
 public:
  explicit ClientFlow(const FrameLimits& limits)
      : calls_(limits.client_burst, limits.client_per_s), overhead_(limits.client_burst, limits.client_per_s) {}
  // True when one more may pass.
  bool take_call(double now_s) {
    const MutexLock lock(mutex_);
    return calls_.take(now_s, 1.0);
  }
  // Calls of the last seconds.
  double recent_calls(double now_s) const {
    const MutexLock lock(mutex_);
    return calls_.used(now_s);
  }
  bool take_overhead(double overhead, double now_s) {
    const MutexLock lock(mutex_);
    return overhead_.take(now_s, overhead);
  }
  // True when nothing has passed lately.
  bool full(double now_s) const {
    const MutexLock lock(mutex_);
    return calls_.full(now_s) && overhead_.full(now_s);
  }
  // The sum of FrameWatch::held_bytes.
  std::atomic<size_t> held_bytes{0};

 private:
  mutable Mutex mutex_;
  TokenBucket calls_ GUARDED(mutex_), overhead_ GUARDED(mutex_);
};

// Not thread-safe.
class FrameWatch {
 public:
  // Without a `client` only the connection's own limits hold.
  explicit FrameWatch(const FrameLimits& limits = {}, std::shared_ptr<ClientFlow> client = nullptr);

  // Takes the next bytes of the client. `now_s` is a monotonic time in seconds. Returns the reason to cut the
  // connection, or nothing. After a reason nothing may be given to it any more.
  std::optional<std::string_view> read(std::span<const std::byte> bytes, double now_s);
  // The same, but only up to the end of the first frame that counts for the pace. Returns the number of bytes that it
  // took.
  size_t read_until_call(std::span<const std::byte> bytes, double now_s);
  // The number of calls that the last frame of the last read counts as for the pace, from 0 (no headers) to a whole
  // burst; not always a whole number.
  double paced_calls() const { return paced_calls_; }
  // Why the connection must be cut, if it must.
  const std::optional<std::string_view>& reason() const { return reason_; }
  // Takes the next bytes of the server, which say what it has taken of each call and which calls have ended.
  void read_answers(std::span<const std::byte> bytes, double now_s);

  // After a reason: the client sent too much. False: what it sent is no HTTP/2.
  bool flooded() const { return flooded_; }
  // The client has sent the preface of HTTP/2 and its first frame.
  bool greeted() const { return greeted_; }
  // Number of calls that the client has begun.
  uint64_t calls() const { return calls_; }
  // When it last sent a part of a call, on the clock of `read`; 0 before.
  double last_call_s() const { return last_call_s_; }
  // An upper estimate of what gRPC holds of messages that are not complete, or that nobody has taken yet, in bytes.
  size_t held_bytes() const { return held_bytes_; }

 private:
  struct FromClient;
  struct FromServer;
  struct Stream {
    StreamMessages messages;
    bool whole = false;    // the client has ended it
    bool over = false;     // the server has ended it
    int frames_after = 0;  // that came after the server's end

    size_t held_bytes() const { return over ? 0 : messages.held_bytes(); }
  };

  size_t take_preface(std::span<const std::byte> bytes);
  void begin_frame(const FrameHead& head, double now_s);
  void begin_headers(const FrameHead& head, double now_s);
  void begin_call(uint32_t id, double now_s);
  void take_data(std::span<const std::byte> payload);
  void end_data(double now_s);
  void end_by_client(const FrameHead& head);
  void grant(uint32_t id);
  void end_by_server(uint32_t id);
  Stream* receiving(const FrameHead& head);
  void forget(uint32_t id);
  template <typename Change>
  void change(Stream& stream, const Change& change);
  double overhead_of(const FrameHead& head) const;
  void take_call(double now_s);
  void take_overhead(double overhead, double now_s);
  void cut(std::string_view reason, bool flood = true);

  const FrameLimits limits_;
  const std::shared_ptr<ClientFlow> client_;
  TokenBucket calls_bucket_, overhead_bucket_, fair_calls_, fair_overhead_;
  size_t preface_left_;  // bytes of the preface that are still to come
  FrameReader from_client_, from_server_;
  size_t header_block_bytes_ = 0;  // of the block that is not complete
  uint32_t newest_stream_ = 0;
  std::unordered_map<uint32_t, Stream> streams_;  // by id
  std::deque<uint32_t> ended_;                    // the newest that the server has ended, the oldest first
  Stream* stream_ = nullptr;                      // of the DATA frame that comes; null: it belongs to no call
  size_t completed_ = 0;                          // messages that this frame has completed
  uint32_t increment_ = 0;                        // of the server's WINDOW_UPDATE that comes
  double paced_calls_ = 0.0;
  std::optional<std::string_view> reason_;
  size_t held_bytes_ = 0;
  bool greeted_ = false, flooded_ = false;
  uint64_t calls_ = 0;
  double last_call_s_ = 0.0;
};

}  // namespace sightline
