// A streaming call of gRPC's asynchronous API as an object with reactions, like a reactor of its callback API, but on a thread
// that is ours (event_loop.h says why).
#pragma once

#include <grpcpp/impl/codegen/proto_utils.h>
#include <grpcpp/server_context.h>
#include <grpcpp/support/async_stream.h>

#include <atomic>
#include <functional>
#include <memory>
#include <utility>

#include "server/rpc/event_loop.h"

namespace sightline {

// What gRPC fills in when a client calls: the context of the call, and what it is answered by. `Request`: of an RPC that takes one
// message, else nothing.
struct NoRequest {};
template <typename Responder, typename Request = NoRequest, typename Context = grpc::ServerContext>
struct IncomingCall {
  // Told when the call has ended, however it did.
  struct End final : Event {
    Event* to = nullptr;
    void ready(bool ok) override { to->ready(ok); }
  };
  Context context;
  Responder responder{&context};
  Request request;
  End end;
};

// Waits for one call. Deletes itself when it came, or when the server has shut down; until then it counts as a call of its loop,
// so that one which comes as the server shuts down is taken and ended like any other.
template <typename Incoming>
class Door final : public Event {
 public:
  // On the loop's thread; makes an AsyncCall of it.
  using Taker = std::function<void(std::unique_ptr<Incoming>)>;

  // `ask(incoming, tag)` is to call Request... of the service.
  template <typename Ask>
  static void open(EventLoop& loop, const Ask& ask, Taker taker) {
    auto* door = new Door(loop, std::move(taker));
    door->incoming_->context.AsyncNotifyWhenDone(&door->incoming_->end);
    ask(*door->incoming_, static_cast<void*>(door));
  }

 private:
  Door(EventLoop& loop, Taker taker)
      : loop_(loop), taker_(std::move(taker)), incoming_(std::make_unique<Incoming>()) {
    loop_.call_begins();
  }
  ~Door() {
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

// One call. Responder: grpc::ServerAsyncReaderWriter, or another of gRPC's. Context: another than usual for calls of any method.
//
// Reactions come on the loop's thread, one at a time, and never inside one of the start functions, which may be called from any
// thread. At most one operation of a kind may be under way. `finish_call` must be called once, whatever becomes of the call; nothing
// may be started after it. `on_done` is the last reaction, after which nothing refers to the call.
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
  virtual void on_done() = 0;

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
  void finish_call(const grpc::Status& status) { incoming_->responder.Finish(status, &finished_); }
  // Of a call that is answered by one message.
  template <typename Message>
  void finish_call(const Message& message, const grpc::Status& status) {
    incoming_->responder.Finish(message, status, &finished_);
  }

  // An operation of another kind, which ends with `over`.
  void begin() { under_way_.fetch_add(1, std::memory_order_relaxed); }
  void over() {
    if (under_way_.fetch_sub(1, std::memory_order_acq_rel) == 1) on_done();
  }

  EventLoop& loop() { return loop_; }
  const Incoming& incoming() const { return *incoming_; }

 private:
  template <void (AsyncCall::*reaction)(bool)>
  class Reaction final : public Event {
   public:
    explicit Reaction(AsyncCall& call) : call_(call) {}
    void ready(bool ok) override {
      (call_.*reaction)(ok);
      call_.over();
    }

   private:
    AsyncCall& call_;
  };

  void react_to_read(bool ok) { on_read(ok); }
  void react_to_write(bool ok) { on_write(ok); }
  void react_to_finish(bool) {}
  void react_to_end(bool) {
    if (incoming_->context.IsCancelled()) on_cancel();
  }

  EventLoop& loop_;
  std::unique_ptr<Incoming> incoming_;
  std::atomic<int> under_way_{2};  // the end and the finish come always
  Reaction<&AsyncCall::react_to_read> read_{*this};
  Reaction<&AsyncCall::react_to_write> written_{*this};
  Reaction<&AsyncCall::react_to_finish> finished_{*this};
  Reaction<&AsyncCall::react_to_end> ended_{*this};
};

}  // namespace sightline
