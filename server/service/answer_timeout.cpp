#include "server/service/answer_timeout.h"

#include <grpc/grpc.h>
#include <grpcpp/server_context.h>

#include <optional>

namespace sightline {
namespace {

using grpc::experimental::InterceptionHookPoints;
using grpc::experimental::ServerRpcInfo;

// One call.
class Watch final : public grpc::experimental::Interceptor {
 public:
  Watch(Timers& timers, ServerRpcInfo& call) : timers_(timers), call_(call) {}
  ~Watch() override {
    if (timer_) timers_.cancel(*timer_);
  }

  void Intercept(grpc::experimental::InterceptorBatchMethods* methods) override {
    if (!timer_ && methods->QueryInterceptionHookPoint(InterceptionHookPoints::PRE_SEND_STATUS)) start();
    methods->Proceed();
  }

 private:
  // The timer holds the call itself, because the interceptor can outlive the call's context, and the timer the
  // interceptor.
  void start() {
    grpc_call* const call = call_.server_context()->c_call();
    grpc_call_ref(call);
    const std::shared_ptr<grpc_call> held(call, &grpc_call_unref);
    timer_ = timers_.start(kMostTimeForAnswer, [held] { grpc_call_cancel(held.get(), nullptr); });
  }

  Timers& timers_;
  ServerRpcInfo& call_;
  std::optional<Timers::Timer> timer_;
};

class Factory final : public grpc::experimental::ServerInterceptorFactoryInterface {
 public:
  explicit Factory(Timers& timers) : timers_(timers) {}

  grpc::experimental::Interceptor* CreateServerInterceptor(ServerRpcInfo* call) override {
    const bool single = call->type() == ServerRpcInfo::Type::UNARY ||
                        call->type() == ServerRpcInfo::Type::CLIENT_STREAMING;
    return single ? new Watch(timers_, *call) : nullptr;
  }

 private:
  Timers& timers_;
};

}  // namespace

std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface> answer_timeouts(Timers& timers) {
  return std::make_unique<Factory>(timers);
}

}  // namespace sightline
