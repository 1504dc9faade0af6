// One session under load: a bidirectional stream of bytes, the ledger of its ticks, and what was measured of them.
//
// Messages are bytes here (the dialect knows what they mean), so that a daemon and a bare echo are driven, timed and counted by
// the very same code. gRPC's asynchronous API; messages are reused by the dialects.
#pragma once

#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/grpcpp.h>

#include <atomic>
#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "client/bench/ledger.h"
#include "client/bench/window.h"
#include "server/base/error.h"
#include "server/rpc/event_loop.h"

namespace sightline {

// Stage times as a reply states them, microseconds.
struct BenchStages {
  double queue = 0.0, scene = 0.0, bound = 0.0, sample = 0.0, aggregate = 0.0, move = 0.0, step = 0.0;
};

// What the server says of a session that it opened; empty for an echo.
struct BenchOpened {
  std::string sampler;
  uint64_t instances = 0, triangles = 0;
};

// What one message of the server says.
struct BenchAnswer {
  enum class Kind { kOpened, kReply, kRejection, kOther };
  Kind kind = Kind::kOther;
  uint64_t sequence = 0;
  uint32_t merged = 0;                     // kReply: earlier ticks that it covers
  std::optional<BenchStages> stages = {};  // kReply of a server that measures
  bool degraded = false;
  std::string trouble = {};  // kRejection, kOther: for a person
  BenchOpened opened = {};   // kOpened
};

// What is said on a stream. One object a stream.
class BenchDialect {
 public:
  virtual ~BenchDialect() = default;
  virtual std::string method() const = 0;
  // The message that opens the stream; false: none is sent and none answered.
  virtual bool opening(grpc::ByteBuffer& message) = 0;
  // Tick 1, 2, ...: in that order, on one thread.
  virtual void tick(uint64_t sequence, grpc::ByteBuffer& message) = 0;
  // On the loop's thread, beside `tick`. May empty `message`.
  virtual BenchAnswer read(grpc::ByteBuffer& message) = 0;
};

class BenchStream {
 public:
  // Starts the call and sends the opening. `loop` moves its messages and must outlive it. `late_ns`: round trips above this are
  // late.
  BenchStream(EventLoop& loop, std::shared_ptr<grpc::Channel> channel, std::unique_ptr<BenchDialect> dialect,
              int64_t late_ns);
  ~BenchStream();  // cancels what is still open, and waits until gRPC is done with it
  BenchStream(const BenchStream&) = delete;
  BenchStream& operator=(const BenchStream&) = delete;

  // Waits for the answer to the opening.
  Result<BenchOpened> wait_opened(std::chrono::nanoseconds timeout);

  // The next tick. `due_ns` is on the clock of `monotonic_ns`. Never blocks: what the connection does not take yet waits here.
  // One thread at a time.
  void send_tick(int64_t due_ns, int window);

  uint64_t ticks_sent() const { return next_sequence_.load(std::memory_order_relaxed) - 1; }
  // Bytes of the last tick sent and of the last reply; 0 before the first.
  size_t last_tick_bytes() const { return last_tick_bytes_.load(std::memory_order_relaxed); }
  size_t last_reply_bytes() const { return last_reply_bytes_.load(std::memory_order_relaxed); }

  // When the oldest tick without an answer was due; INT64_MAX: all have theirs.
  int64_t oldest_pending_ns() const;
  // What was measured of the ticks of one window, once; then it is gone from here.
  BenchWindow take_window(int window);
  // Of the whole life of the stream.
  TickCounts counts() const;
  // The first rejection, or what else the server said that no load expects.
  std::string trouble() const;
  // Why the stream ended, once it has.
  std::optional<Error> end() const;

  // Says that no more ticks come, and waits for the end of the stream; what is still pending is lost.
  Status close(std::chrono::nanoseconds timeout);

  // The clock of due times: steady_clock.
  static int64_t monotonic_ns();

 private:
  // An operation of the call, and what is to be done when it is over. On the loop's thread.
  template <void (BenchStream::*reaction)(bool)>
  struct Reaction final : Event {
    explicit Reaction(BenchStream& its_stream) : stream(its_stream) {}
    void ready(bool ok) override { (stream.*reaction)(ok); }
    BenchStream& stream;
  };
  void on_start(bool ok);
  void on_read(bool ok);
  void on_write(bool ok);
  void on_writes_done(bool ok);
  void on_end(bool ok);

  // Need mutex_.
  void start_next_write();
  void write_on(bool ok);
  void finish_writing();
  void over();  // of an operation
  void take_answer(const BenchAnswer& answer, size_t bytes, int64_t now_ns);
  void count_reply(const BenchAnswer& answer, size_t bytes, int64_t now_ns);
  BenchWindow& window_at(int window);

  // Constant after construction.
  const std::unique_ptr<BenchDialect> dialect_;
  const int64_t late_ns_;
  const std::shared_ptr<grpc::Channel> channel_;
  grpc::GenericStub stub_;

  grpc::ClientContext context_;
  std::unique_ptr<grpc::GenericClientAsyncReaderWriter> call_;
  grpc::ByteBuffer reply_;  // gRPC's while a read is under way
  Reaction<&BenchStream::on_start> start_{*this};
  Reaction<&BenchStream::on_read> read_{*this};
  Reaction<&BenchStream::on_write> written_{*this};
  Reaction<&BenchStream::on_writes_done> writes_done_event_{*this};
  Reaction<&BenchStream::on_end> end_event_{*this};

  std::atomic<uint64_t> next_sequence_{1};
  std::atomic<size_t> last_tick_bytes_{0}, last_reply_bytes_{0};

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  // Guarded by mutex_.
  std::deque<grpc::ByteBuffer> unsent_;  // the front is on its way while writing_
  TickLedger ledger_;
  std::vector<SettledTick> settled_;  // by one reply: kept for its memory
  std::deque<BenchWindow> windows_;   // from first_window_ on
  int first_window_ = 0;
  std::string trouble_;
  std::optional<BenchOpened> opened_;
  bool writing_ = false;
  bool closing_ = false;
  int under_way_ = 0;         // operations
  bool writes_done_ = false;  // no more are written
  bool ended_ = false;        // nothing more happens on the loop
  grpc::Status end_status_;   // gRPC's until then
};

}  // namespace sightline
