// The health service of gRPC's health checking protocol.
//
// gRPC's own health service is not used, because it runs on the callback API. That API starts further threads, and every
// message then wakes one of them in addition to the event loop. This service is answered by an event loop, so it also answers
// when clients occupy all threads of the synchronous RPCs.
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

  // `loop` takes all calls from now until the server shuts down.
  void take_calls(EventLoop& loop);

  // Sets the state of a service, given by its full name; "" means the whole server. Watchers are notified.
  void set(const std::string& service, bool serving);
  // Ends all Watch calls, now and later. A server that shuts down would wait for them.
  void end_watches();

 private:
  class Checker;
  class Watcher;
  void take_checks(EventLoop& loop);
  void take_watches(EventLoop& loop);
  // SERVICE_UNKNOWN when the service was never set.
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
