// Ends a call with a single answer whose client does not take the answer.
//
// A client decides how much it is sent (the windows of HTTP/2). The handler of a synchronous RPC waits in gRPC until
// its answer is on the way, which can last for ever, and there are few threads for handlers. gRPC has no time limit for
// that.
//
// The way to know when an answer begins, and when its call is over, is an interceptor for each such call. Streams have
// none: they look after themselves.
#pragma once

#include <grpcpp/support/server_interceptor.h>

#include <chrono>
#include <memory>

#include "server/rpc/timers.h"

namespace sightline {

// A client that reads takes an answer within milliseconds.
constexpr std::chrono::seconds kMostTimeForAnswer{5};

// To be given to the builder of a server, which `timers` must outlive.
std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface> answer_timeouts(Timers& timers);

}  // namespace sightline
