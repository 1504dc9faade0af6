// The health service of gRPC's health checking protocol.
//
// gRPC brings one, which runs on its callback API: its mere presence starts threads that wait beside the event loops, and each
// message then wakes one of them too. This one is answered by a loop: clients that hold all threads of the synchronous RPCs do not
// make a platform take the daemon for dead.
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "grpc/health/v1/health.grpc.pb.h"
#include "server/rpc/event_loop.h"

namespace sightline {

// Thread-safe, as gRPC asks. It must outlive the gRPC server and the loops.
class HealthService final : public grpc::health::v1::Health::AsyncService {
 public:
  using Serving = grpc::health::v1::HealthCheckResponse::ServingStatus;

  // All calls are taken by one loop, from now until the server shuts down.
  void take_calls(EventLoop& loop);

  // Of a service by its full name; "" is the server. Those that watch are told.
  void set(const std::string& service, bool serving);
  // Nobody watches any longer: a server that shuts down would wait for those calls.
  void end_watches();

 private:
  class Checker;
  class Watcher;
  void take_checks(EventLoop& loop);
  void take_watches(EventLoop& loop);
  // SERVICE_UNKNOWN of one that was never set.
  Serving status_of(const std::string& service) const;
  void admit(const std::shared_ptr<Watcher>& watcher);
  void remove(const Watcher* watcher);

  mutable std::mutex mutex_;
  // Guarded by mutex_.
  std::map<std::string, bool> serving_;
  std::vector<std::shared_ptr<Watcher>> watchers_;
  bool ended_ = false;
};

}  // namespace sightline
