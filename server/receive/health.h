// The health service of gRPC's health checking protocol.
//
// gRPC brings one, which runs on its callback API: its mere presence starts threads that wait beside the event loops, and each
// message then wakes one of them too.
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "grpc/health/v1/health.grpc.pb.h"
#include "server/receive/event_loop.h"

namespace sightline {

// Thread-safe, as gRPC asks. It must outlive the gRPC server and the loops.
class HealthService final
    : public grpc::health::v1::Health::WithAsyncMethod_Watch<grpc::health::v1::Health::Service> {
 public:
  using Serving = grpc::health::v1::HealthCheckResponse::ServingStatus;

  // All calls of Watch are taken by one loop, from now until the server shuts down.
  void take_calls(EventLoop& loop);

  // Of a service by its full name; "" is the server. Those that watch are told.
  void set(const std::string& service, bool serving);
  // Nobody watches any longer: a server that shuts down would wait for those calls.
  void end_watches();

  grpc::Status Check(grpc::ServerContext* context, const grpc::health::v1::HealthCheckRequest* request,
                     grpc::health::v1::HealthCheckResponse* response) override;

 private:
  class Watcher;
  Serving watched_status(const std::string& service) const;
  void admit(const std::shared_ptr<Watcher>& watcher);
  void remove(const Watcher* watcher);

  mutable std::mutex mutex_;
  // Guarded by mutex_.
  std::map<std::string, bool> serving_;
  std::vector<std::shared_ptr<Watcher>> watchers_;
  bool ended_ = false;
};

}  // namespace sightline
