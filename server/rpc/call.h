// A streaming call of gRPC's asynchronous API as an object with reactions. It resembles a reactor of gRPC's callback
// API, but its reactions run on a thread of our own (event_loop.h says why).
#pragma once

#include <grpcpp/impl/codegen/proto_utils.h>
#include <grpcpp/server_context.h>
#include <grpcpp/support/async_stream.h>

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <new>
#include <utility>

#include "server/rpc/event_loop.h"
#include "server/rpc/timers.h"

namespace sightline {

// The parts of a call that gRPC fills in when a client calls. They are its context, the object that answers it and, for
// an RPC with a single request, that request.
struct NoRequest {};
template <typename Responder, typename Request = NoRequest, typename Context = grpc::ServerContext>
struct IncomingCall {
  // Forwards the end of the call to the object that owns the call by then.
  struct End final : Event {
    Event* to = nullptr;
    void ready(bool ok) override { to->ready(ok); }
  };
  Context context;
  Responder responder{&context};
  Request request;
  End end;
};

// Waits for one call. It deletes itself when the call came or the server has shut down. Until then it counts as a call
// of its loop, so a call that comes during the shutdown is taken and ended like any other.
template <typename Incoming>
class CallAcceptor final : public Event {
 public:
  // Makes an AsyncCall of the incoming call. Runs on the loop's thread.
  using Taker = std::function<void(std::unique_ptr<Incoming>)>;

  // `ask(incoming, tag)` must call the service's Request... function.
  template <typename Ask>
  static void start(EventLoop& loop, const Ask& ask, Taker taker) {
    auto* acceptor = new CallAcceptor(loop, std::move(taker));
    acceptor->incoming_->context.AsyncNotifyWhenDone(&acceptor->incoming_->end);
    ask(*acceptor->incoming_, static_cast<void*>(acceptor));
  }

 private:
  CallAcceptor(EventLoop& loop, Taker taker)
      : loop_(loop), taker_(std::move(taker)), incoming_(std::make_unique<Incoming>()) {
    loop_.call_begins();
  }
  ~CallAcceptor() {
    incoming_.reset();
    loop_.call_ends();
  }
  void ready(bool ok) override {
    if (ok) taker_(std::move(incoming_));
    delete this;
  }

  EventLoop& loop_;
  const Taker taker_;
  std::unique_ptr<Incoming> incoming_;
};

// One call. Responder is grpc::ServerAsyncReaderWriter or another of gRPC's responders; Context differs from the
// default only for calls of any method.
//
// Reactions run on the loop's thread, one at a time, and never inside one of the start functions. The start functions
// may be called from any thread. At most one operation of each kind may be under way. `finish_call` must be called
// exactly once for every call, and nothing may be started after it. `on_done` is the last reaction; after it nothing
// refers to the call any more.
template <typename Responder, typename Request = NoRequest, typename Context = grpc::ServerContext>
class AsyncCall {
 public:
  using Incoming = IncomingCall<Responder, Request, Context>;

  AsyncCall(EventLoop& loop, std::unique_ptr<Incoming> incoming) : loop_(loop), incoming_(std::move(incoming)) {
    incoming_->end.to = &ended_;
    loop_.call_begins();
  }
  AsyncCall(const AsyncCall&) = delete;
  AsyncCall& operator=(const AsyncCall&) = delete;

 protected:
  virtual ~AsyncCall() {
    incoming_.reset();
    loop_.call_ends();
  }

  // Reactions. `ok` is false when the client will send nothing more, or is gone.
  virtual void on_read(bool) {}
  virtual void on_write(bool) {}
  virtual void on_cancel() {}
  virtual void on_alarm(bool) {}  // true: the time has passed; false: the alarm was cancelled
  virtual void on_done() = 0;
  // A reaction found no memory. Runs once for each such reaction.
  virtual void on_no_memory() { cancel_call(); }

  template <typename Message>
  void start_read(Message& message) {
    begin();
    incoming_->responder.Read(&message, &read_);
  }
  template <typename Message>
  void start_write(const Message& message) {
    begin();
    incoming_->responder.Write(message, &written_);
  }
  // One alarm at a time; the next may be started from `on_alarm`. It must be cancelled before the call can end earlier
  // than the alarm. `timers` must outlive the call. Both functions are called from one thread at a time.
  void start_alarm(Timers& timers, std::chrono::milliseconds timeout) {
    begin();
    timers_ = &timers;
    ran_out_ = true;
    alarm_ = timers.start(timeout, [this] { loop_.post(alarmed_); });
  }
  void cancel_alarm() {
    if (!timers_ || !timers_->cancel(alarm_)) return;
    ran_out_ = false;
    loop_.post(alarmed_);
  }
  void finish_call(const grpc::Status& status) { incoming_->responder.Finish(status, &finished_); }
  // Ends the call at once, and with it a write that its client does not take. `on_cancel` follows.
  void cancel_call() { incoming_->context.TryCancel(); }
  // For RPCs that are answered by a single message.
  template <typename Message>
  void finish_call(const Message& message, const grpc::Status& status) {
    incoming_->responder.Finish(message, status, &finished_);
  }

  EventLoop& loop() { return loop_; }
  const Incoming& incoming() const { return *incoming_; }

 private:
  template <void (AsyncCall::*reaction)(bool)>
  class Reaction final : public Event {
   public:
    explicit Reaction(AsyncCall& call) : call_(call) {}
    void ready(bool ok) override {
      try {
        (call_.*reaction)(ok);
      } catch (const std::bad_alloc&) {
        call_.on_no_memory();
      }
      call_.over();
    }

   private:
    AsyncCall& call_;
  };

  void begin() { under_way_.fetch_add(1, std::memory_order_relaxed); }
  void over() {
    if (under_way_.fetch_sub(1, std::memory_order_acq_rel) == 1) on_done();
  }
  void react_to_read(bool ok) { on_read(ok); }
  void react_to_write(bool ok) { on_write(ok); }
  void react_to_alarm(bool) { on_alarm(ran_out_); }
  void react_to_finish(bool) {}
  void react_to_end(bool) {
    if (incoming_->context.IsCancelled()) on_cancel();
  }

  EventLoop& loop_;
  std::unique_ptr<Incoming> incoming_;
  // Of the newest alarm.
  Timers* timers_ = nullptr;
  Timers::Timer alarm_;
  std::atomic<bool> ran_out_{false};  // it was not cancelled; atomic, since gRPC alone orders the write and the read
  std::atomic<int> under_way_{2};     // every call has an end and a finish
  Reaction<&AsyncCall::react_to_read> read_{*this};
  Reaction<&AsyncCall::react_to_write> written_{*this};
  Reaction<&AsyncCall::react_to_alarm> alarmed_{*this};
  Reaction<&AsyncCall::react_to_finish> finished_{*this};
  Reaction<&AsyncCall::react_to_end> ended_{*this};
};

}  // namespace sightline
