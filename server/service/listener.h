// The gRPC server with its addresses, the standard health service and reflection.
#pragma once

#include <grpcpp/server.h>

#include <chrono>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "server/base/error.h"
#include "server/gate/gate.h"
#include "server/rpc/event_loop.h"
#include "server/service/health.h"
#include "server/service/reflection.h"
#include "server/service/service.h"

namespace sightline {

struct ListenOptions {
  std::string tcp = "127.0.0.1:50151";         // host:port; port 0 takes a free one; empty: no TCP
  std::string unix_path;                       // empty: no unix socket
  unsigned unix_mode = 0660;                   // of the socket file
  size_t max_message_bytes = size_t{4} << 20;  // of a call that no other limit ends (ServiceLimits::max_message_bytes)
  size_t max_health_watches = 512, max_reflection_calls = 16;
  unsigned loops = 1;  // event loops; one is enough for hundreds of sessions
  GateLimits gate;     // of connections
  // Connections over TCP are encrypted with these; null: they are not. Must outlive the listener.
  const TlsKeys* tls = nullptr;
  // A TCP address that other hosts can reach needs TLS, and callers that must show who they are. Otherwise it is an
  // error.
  bool callers_are_known = false;
  bool allow_insecure_network = false;                                    // true: it is not
  Gate::Notice on_refused = [](const std::string&, std::string_view) {};  // a connection was refused or cut
  // A connection without traffic for `keepalive_time` is pinged. Its calls end when no answer comes in the timeout.
  std::chrono::milliseconds keepalive_time{10'000};
  std::chrono::milliseconds keepalive_timeout{5'000};
};

// Neither address may be in use by another daemon. TCP ports are not shared, and a unix socket that a process serves is
// left alone. A socket file that no process serves any more is replaced.
class Listener {
 public:
  // Whether the options name addresses that can be listened at, and may be. Takes none of them. Fails as `start` does.
  static Status check(const ListenOptions& options);
  // Starts to serve. `service` must outlive the listener. Fails with kUnavailable or kInvalidArgument (fields
  // "--listen" and "--listen-unix").
  static Result<std::unique_ptr<Listener>> start(const ListenOptions& options, CameraControlService& service);
  // Stops without grace.
  ~Listener();

  // The addresses for clients, such as "127.0.0.1:50151" and "unix:/run/sightline.sock".
  const std::vector<std::string>& addresses() const { return addresses_; }
  // The TCP port; 0 without TCP.
  int port() const { return port_; }

  GateCounts connections() const { return gate_->counts(); }

  // What the health service answers for the daemon and its services. Everything else goes on. From any thread.
  void set_serving(bool serving);
  // What it answers for "liveness". It begins with SERVING.
  void set_alive(bool alive);

  // How long the slowest event loop has owed a sign of life (less if it was busy), and how long ago the slowest thread
  // of the gate last went round. To be called about once a second, from any thread, until `stop`.
  std::chrono::duration<double> loops_silent() const;
  std::chrono::duration<double> gate_silent() const { return std::chrono::duration<double>(gate_->silent_s()); }
  // Takes no new calls, waits for the open ones, and cancels them after `grace`. Blocks until the last one has ended.
  // May be called again.
  void stop(std::chrono::milliseconds grace);

 private:
  Listener() = default;
  void shut_down(std::chrono::milliseconds grace);

  // Every connection comes through it, so it exists before the first call.
  std::unique_ptr<Gate> gate_;
  HealthService health_;
  ReflectionService reflection_;
  std::unique_ptr<grpc::Server> server_;
  // Destroyed before server_, after it has shut down.
  std::vector<std::unique_ptr<EventLoop>> loops_;
  std::unique_ptr<EventLoop> health_loop_;  // answers probes while the work of clients holds the others up
  std::vector<std::string> addresses_;
  int port_ = 0;
};

}  // namespace sightline
