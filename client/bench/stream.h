// One session under load: a bidirectional stream, the log of its ticks, and the measurements of them. Uses gRPC's
// asynchronous API with one thread; protocol.h has the messages.
#pragma once

#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/grpcpp.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "client/bench/protocol.h"
#include "client/bench/request_log.h"
#include "client/bench/result.h"
#include "server/base/error.h"
#include "server/rpc/event_loop.h"

namespace sightline {

class BenchStream {
 public:
  // Starts the call and sends the opening. `loop` moves the messages and must outlive the stream. Round trips of more
  // than `late_ns` count as late. `token` shows the server who calls; empty: nothing does.
  BenchStream(EventLoop& loop, std::shared_ptr<grpc::Channel> channel, BenchProtocol protocol, int64_t late_ns,
              const std::string& token);
  ~BenchStream();  // cancels the call if it is still open, and waits for its end
  BenchStream(const BenchStream&) = delete;
  BenchStream& operator=(const BenchStream&) = delete;

  // Waits for the answer to the opening.
  Result<BenchOpened> wait_opened(std::chrono::nanoseconds timeout);

  // Sends the next tick. `due_ns` is on the clock of monotonic_ns; `window` is where the tick counts, or -1. Never
  // blocks: messages that the connection cannot take yet are queued here. Called by one thread at a time.
  void send_tick(int64_t due_ns, int window);

  // Lengths of the last tick and of the last reply; 0 before the first.
  MessageSizes last_sizes() const { return {last_tick_bytes_, last_reply_bytes_}; }
  // The due time of the oldest unanswered tick; INT64_MAX when every tick has its answer.
  int64_t oldest_pending_ns() const;
  // Takes the measurements of one window. Windows must be taken in order, and each once.
  BenchWindow take_window(int window);
  // The counts since the stream began.
  TickCounts counts() const;
  // The first rejection or other message that no load expects; "" without one.
  std::string trouble() const;
  // Why the stream ended, once it has.
  std::optional<Error> end() const;

  // Says that no more ticks follow, and waits for the end of the stream. Pending ticks count as lost.
  Status close(std::chrono::nanoseconds timeout);

  // steady_clock: the clock of due times.
  static int64_t monotonic_ns();

 private:
  // An operation of the call; `reaction` is called on the loop's thread when it has ended.
  template <void (BenchStream::*reaction)(bool)>
  struct Reaction final : Event {
    explicit Reaction(BenchStream& its_stream) : stream(its_stream) {}
    void ready(bool ok) override { (stream.*reaction)(ok); }
    BenchStream& stream;
  };
  void on_start(bool ok);
  void on_read(bool ok);
  void on_write(bool ok);
  void on_last(bool);  // of WritesDone and Finish

  // These need mutex_.
  void write_next(bool ok);
  void start_write();
  void finish_writing();
  void operation_over();
  void take_answer(const BenchAnswer& answer, size_t bytes, int64_t now_ns);
  void count_reply(const BenchAnswer& answer, size_t bytes, int64_t now_ns);
  BenchWindow* open_window(int window);

  // Constant after construction.
  const BenchProtocol protocol_;
  const int64_t late_ns_;
  const std::shared_ptr<grpc::Channel> channel_;
  grpc::GenericStub stub_;

  grpc::ClientContext context_;
  std::unique_ptr<grpc::GenericClientAsyncReaderWriter> call_;
  grpc::ByteBuffer reply_;  // belongs to gRPC while a read is under way
  Reaction<&BenchStream::on_start> start_{*this};
  Reaction<&BenchStream::on_read> read_{*this};
  Reaction<&BenchStream::on_write> written_{*this};
  Reaction<&BenchStream::on_last> writes_done_event_{*this}, end_event_{*this};

  uint64_t next_sequence_ = 1;  // used by the sending thread
  std::atomic<size_t> last_tick_bytes_{0}, last_reply_bytes_{0};

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  // Guarded by mutex_.
  std::deque<grpc::ByteBuffer> unsent_;  // the front is being written while writing_
  RequestLog log_;
  std::vector<SettledTick> settled_;  // a member only to reuse its memory
  std::map<int, BenchWindow> windows_;
  int first_window_ = 0;  // windows before this one were taken
  std::string trouble_;
  std::optional<BenchOpened> opened_;
  bool writing_ = false;
  bool closing_ = false;
  int under_way_ = 0;  // operations of the call
  bool writes_done_ = false;
  bool ended_ = false;       // nothing more happens on the loop
  grpc::Status end_status_;  // belongs to gRPC until ended_
};

}  // namespace sightline
