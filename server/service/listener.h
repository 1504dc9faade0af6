// Where the service listens, and the gRPC server behind it, with the standard health service and reflection.
#pragma once

#include <grpcpp/server.h>

#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include "server/base/error.h"
#include "server/rpc/event_loop.h"
#include "server/service/health.h"
#include "server/service/service.h"

namespace sightline {

struct ListenOptions {
  std::string tcp = "127.0.0.1:50151";  // host:port; port 0 takes a free one; empty: no TCP
  std::string unix_path;                // empty: no unix socket
  unsigned unix_mode = 0660;            // of the socket file
  size_t max_message_bytes = size_t{4} << 20;
  unsigned loops = 1;  // event loops; one moves the messages of hundreds of sessions
  // A peer that has been silent for `keepalive_time` is pinged; without an answer its calls end after the
  // timeout.
  std::chrono::milliseconds keepalive_time{10'000};
  std::chrono::milliseconds keepalive_timeout{5'000};
};

// Neither address may be in use by another daemon: TCP ports are not shared, and a unix socket at which
// somebody answers is left alone. A socket file that nobody serves any more is replaced.
class Listener {
 public:
  // Serves from now on. `service` must outlive it. Fails (fields "--listen", "--listen-unix") with
  // kUnavailable or kInvalidArgument.
  static Result<std::unique_ptr<Listener>> start(const ListenOptions& options, CameraControlService& service);
  // As stop with no grace.
  ~Listener();

  // What to connect to: "127.0.0.1:50151", "unix:/run/sightline.sock".
  const std::vector<std::string>& addresses() const { return addresses_; }
  // The TCP port; 0 without TCP.
  int port() const { return port_; }

  // The health service says NOT_SERVING from now on; everything else goes on.
  void set_not_serving();
  // Takes no new calls, waits for the open ones, cancels them after `grace`. Blocks. May be called again.
  void stop(std::chrono::milliseconds grace);

 private:
  Listener() = default;
  void set_serving(bool serving);

  HealthService health_;
  std::unique_ptr<grpc::Server> server_;
  std::vector<std::unique_ptr<EventLoop>> loops_;  // go before the server, which must have shut down
  std::vector<std::string> addresses_;
  int port_ = 0;
};

}  // namespace sightline
