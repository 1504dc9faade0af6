#include "server/service/answer_timeout.h"

#include <grpc/grpc.h>
#include <grpcpp/alarm.h>
#include <grpcpp/server_context.h>

#include <utility>

namespace sightline {

using grpc::experimental::InterceptionHookPoints;
using grpc::experimental::ServerRpcInfo;

// Holds the call itself, because the interceptor can outlive the call's context.
class AnswerTimeout::Timer final : public Event {
 public:
  static std::shared_ptr<Timer> start(EventLoop& loop, grpc_call* call) {
    auto timer = std::make_shared<Timer>(loop, call);
    timer->self_ = timer;
    timer->alarm_.Set(&loop.queue(), std::chrono::system_clock::now() + kMostTime, static_cast<Event*>(timer.get()));
    return timer;
  }
  Timer(EventLoop& loop, grpc_call* call) : loop_(loop), call_(call) {
    loop_.call_begins();
    grpc_call_ref(call_);
  }
  ~Timer() { grpc_call_unref(call_); }

  // From any thread, at most once.
  void stop() { alarm_.Cancel(); }

 private:
  void ready(bool ran_out) override {
    if (ran_out) grpc_call_cancel(call_, nullptr);
    EventLoop& loop = loop_;
    self_.reset();
    loop.call_ends();
  }

  EventLoop& loop_;
  grpc_call* const call_;
  grpc::Alarm alarm_;
  std::shared_ptr<Timer> self_;  // until `ready`
};

// One call.
class AnswerTimeout::Watch final : public grpc::experimental::Interceptor {
 public:
  Watch(EventLoop& loop, ServerRpcInfo& call) : loop_(loop), call_(call) {}
  ~Watch() override {
    if (timer_) timer_->stop();
  }

  void Intercept(grpc::experimental::InterceptorBatchMethods* methods) override {
    if (!timer_ && methods->QueryInterceptionHookPoint(InterceptionHookPoints::PRE_SEND_STATUS))
      timer_ = Timer::start(loop_, call_.server_context()->c_call());
    methods->Proceed();
  }

 private:
  EventLoop& loop_;
  ServerRpcInfo& call_;
  std::shared_ptr<Timer> timer_;
};

class AnswerTimeout::Factory final : public grpc::experimental::ServerInterceptorFactoryInterface {
 public:
  explicit Factory(const std::atomic<EventLoop*>& loop) : loop_(loop) {}

  grpc::experimental::Interceptor* CreateServerInterceptor(ServerRpcInfo* call) override {
    EventLoop* const loop = loop_.load();
    const bool single = call->type() == ServerRpcInfo::Type::UNARY || call->type() == ServerRpcInfo::Type::CLIENT_STREAMING;
    return single && loop ? new Watch(*loop, *call) : nullptr;
  }

 private:
  const std::atomic<EventLoop*>& loop_;
};

std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface> AnswerTimeout::interceptors() {
  return std::make_unique<Factory>(loop_);
}

}  // namespace sightline
