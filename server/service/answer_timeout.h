// Ends a call with a single answer whose client does not take the answer.
//
// A client decides how much it is sent (the windows of HTTP/2). The handler of a synchronous RPC waits in gRPC until its answer is on the
// way, which can last for ever, and there are few threads for handlers. gRPC has no time limit for that.
//
// The way to know when an answer begins, and when its call is over, is an interceptor for each such call. Streams have none: they
// look after themselves.
#pragma once

#include <grpcpp/support/server_interceptor.h>

#include <atomic>
#include <chrono>
#include <memory>

#include "server/rpc/event_loop.h"

namespace sightline {

// Made for one server. Thread-safe. It must outlive the server.
class AnswerTimeout {
 public:
  // A client that reads takes an answer within milliseconds.
  static constexpr std::chrono::seconds kMostTime{5};

  // To be given to the server's builder.
  std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface> interceptors();
  // The loop that carries the timers. Called once, before the first call. It must have its last call before its server ends.
  void use(EventLoop& loop) { loop_.store(&loop); }

 private:
  class Timer;
  class Watch;
  class Factory;

  std::atomic<EventLoop*> loop_{nullptr};
};

}  // namespace sightline
