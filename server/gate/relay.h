// The thread that moves bytes between clients and gRPC, and watches what the clients send.
//
// gRPC owns its end of each socket pair. The relay holds at most kMostHeld bytes for each direction of a connection: it
// reads from one side only when the other side has taken everything. A client that stops reading is therefore stopped
// by gRPC's flow control as if there were no relay. Once gRPC has closed, the client has 2 s to take what is left in
// the pair.
//
// A connection for whose bytes no memory is left is cut; the others go on.
//
// Each new call takes gRPC and the service about 0.1 ms, so a thousand of them at once would hold up all sessions. The
// relay lets calls begin at a rate. What comes after a call for which there is no room waits, in turns: the client that
// began the fewest calls lately goes on first.
//
// A connection with TLS is decrypted here, so that its frames can be watched. Its handshake takes up to a millisecond
// of CPU; a relay of its own, the greeter, does all handshakes, so that a client that connects again and again delays
// no session.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <string_view>
#include <thread>
#include <vector>

#include "server/base/mutex.h"
#include "server/base/token_bucket.h"
#include "server/gate/connection.h"
#include "server/gate/frame_watch.h"

namespace sightline {

class Relay {
 public:
  // Runs on the relay's thread when a connection is over, before its sockets are closed. `reason` is empty unless the
  // relay cut it for what the client sent.
  using Over = std::function<void(const std::shared_ptr<Connection>&, std::string_view reason)>;

  // Runs on the relay's thread when gRPC holds more or less for a connection than before: `change`, in bytes.
  using Holds = std::function<void(const Connection&, ptrdiff_t change)>;

  // Starts the thread.
  Relay(const FrameLimits& limits, Over over, Holds holds);
  // Closes all connections.
  ~Relay();
  Relay(const Relay&) = delete;
  Relay& operator=(const Relay&) = delete;

  // Takes a connection over, whose sockets must not block. From any thread.
  void add(std::shared_ptr<Connection> connection);
  // Chooses the relay that gets a connection after its handshake. Without it, the connection stays. Set before the
  // first `add`.
  void pass_on_to(std::function<Relay&()> next) { next_ = std::move(next); }

  // Bytes that came from clients and went to them, since the start. From any thread.
  uint64_t received_bytes() const { return received_bytes_.load(std::memory_order_relaxed); }
  uint64_t sent_bytes() const { return sent_bytes_.load(std::memory_order_relaxed); }
  // When the thread last went round, which it does at least every kBeatMs: a time of gate_now_s(). From any thread.
  double last_beat_s() const { return beat_s_.load(std::memory_order_relaxed); }

 private:
  static constexpr int kBeatMs = 250;
  static constexpr size_t kMostHeld = 64 << 10;
  // Of what TLS itself has to say to a client that does not read.
  static constexpr size_t kMostAnswers = 4 * kMostHeld;
  // How often lines are looked at that wait for room for a call.
  static constexpr int kPaceMs = 2;
  struct Line;
  struct Side;
  // Lines go from one map to another as nodes, for which no memory is needed: a line must not be lost when there is
  // none.
  using Lines = std::map<const Line*, std::unique_ptr<Line>>;

  void run();
  void adopt(Lines::node_type line);
  void hand_on_leaving();
  void take_new();
  void begin(Line& line);
  void guarded(Line& line, const std::function<void()>& work);
  void serve(Side& side, uint32_t events);
  bool read_from(Side& side);
  bool take_from_client(Line& line, std::span<const std::byte> bytes);
  bool take_from_grpc(Line& line, std::span<const std::byte> bytes);
  bool decrypt(Line& line, std::span<const std::byte> bytes);
  bool send_answers(Line& line);
  void finish_handshake(Line& line);
  void pass_on(Line& line);
  bool pass_to_grpc(Line& line, std::span<const std::byte> bytes);
  size_t watch_client(Line& line, std::span<const std::byte> bytes);
  void let_waiting_go_on();
  Line* next_waiting() const;
  void note_held(Line& line, size_t bytes);
  bool write_to(Side& side, const std::byte* bytes, size_t size);
  bool flush(Side& side);
  bool adjust(Side& side);
  void settle(Line& line);
  void end(Line& line, std::string_view reason);

  const FrameLimits limits_;
  const Over over_;
  const Holds holds_;
  const FileDescriptor epoll_, wake_;

  // Used by the thread only.
  std::function<Relay&()> next_;  // set before the first connection
  Lines lines_;
  Lines leaving_;                      // they go to the next relay after the events of this round
  Lines ended_;                        // kept until the events of this round are served
  std::map<uint64_t, Line*> waiting_;  // until there is room for another call, in the order in which they came
  uint64_t next_place_ = 1;
  TokenBucket calls_;
  std::array<std::byte, kMostHeld> buffer_;
  std::vector<std::byte> plain_, sealed_;  // reused

  std::atomic<uint64_t> received_bytes_{0}, sent_bytes_{0};
  std::atomic<double> beat_s_{gate_now_s()};

  Mutex mutex_;
  Lines new_ GUARDED(mutex_);
  bool stopping_ GUARDED(mutex_) = false;

  std::thread thread_;
};

}  // namespace sightline
