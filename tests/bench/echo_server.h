// A bare gRPC echo: the lower bound of every round trip of `sightline bench --echo`. It uses the event loop and the
// channel arguments of the daemon's listener, so its cost is the cost of gRPC. client/bench/protocol.h defines its
// messages; a message without a header ends the stream, and no answer is longer than 4 MiB.
#pragma once

#include <grpcpp/generic/async_generic_service.h>
#include <grpcpp/grpcpp.h>

#include <memory>
#include <string>

#include "server/base/error.h"
#include "server/rpc/event_loop.h"

namespace sightline {

class EchoServer {
 public:
  // `address`: "host:port" (port 0: a free one) or "unix:/path". Serves until it is destroyed.
  static Result<std::unique_ptr<EchoServer>> start(const std::string& address);
  ~EchoServer();

  // The address to connect to.
  const std::string& address() const { return address_; }

 private:
  class Call;
  EchoServer();
  void take_calls();

  grpc::AsyncGenericService service_;
  std::unique_ptr<grpc::Server> server_;
  std::unique_ptr<EventLoop> loop_;  // destroyed after the server's shutdown and before the server
  std::string address_;
};

}  // namespace sightline
