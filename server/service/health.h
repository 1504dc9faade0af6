// The health service of gRPC's health checking protocol.
//
// gRPC's own health service is not used, because it runs on the callback API. That API starts further threads, and
// every message then wakes one of them in addition to the event loop. This service has an event loop of its own, so it
// also answers when clients occupy all threads of the synchronous RPCs, and while their steps hold up the loops of
// their streams. It answers everyone, also callers without credentials, so what it keeps for them is bounded.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include <grpcpp/server_context.h>
#include <grpcpp/support/status.h>

#include "grpc/health/v1/health.grpc.pb.h"
#include "server/base/mutex.h"
#include "server/rpc/event_loop.h"

namespace sightline {

// Thread-safe, as gRPC asks. It must outlive the gRPC server and the loops.
class HealthService final : public grpc::health::v1::Health::AsyncService {
 public:
  using Serving = grpc::health::v1::HealthCheckResponse::ServingStatus;

  // A Watch call for a longer name is refused. The daemon's own names are shorter.
  static constexpr size_t kLongestName = 256;

  // The most Watch calls that may be open at the same time, three quarters of them of one client, which needs one for
  // each connection. How a client is called, and what to do when it is refused a call. Set before take_calls; both run
  // on the loop's thread.
  using ClientOf = std::function<std::string(const grpc::ServerContext&)>;
  void limit_watches_by(size_t most, ClientOf client_of, std::function<void()> refused) {
    most_watches_ = most;
    client_of_ = std::move(client_of);
    refused_ = std::move(refused);
  }
  // `loop` takes all calls from now until the server shuts down.
  void take_calls(EventLoop& loop);

  // Sets the state of a service, given by its full name; "" means the whole server. Watchers are notified.
  void set(const std::string& service, bool serving);
  // Ends all Watch calls, now and later. A server that shuts down would wait for them.
  void end_watches();

 private:
  class Checker;
  class Watcher;
  class Refused;
  void take_checks(EventLoop& loop);
  void take_watches(EventLoop& loop);
  // SERVICE_UNKNOWN when the service was never set.
  Serving status_of(const std::string& service) const;
  std::optional<grpc::Status> refusal(const std::string& service, const std::string& client);
  void admit(const std::shared_ptr<Watcher>& watcher);
  std::vector<std::shared_ptr<Watcher>> watchers() const NEEDS(mutex_);
  void remove(const Watcher* watcher);

  size_t most_watches_ = 512;
  ClientOf client_of_ = [](const grpc::ServerContext& context) { return context.peer(); };
  std::function<void()> refused_ = [] {};
  mutable Mutex mutex_;
  std::map<std::string, bool> serving_ GUARDED(mutex_);
  std::unordered_map<const Watcher*, std::shared_ptr<Watcher>> watchers_ GUARDED(mutex_);
  std::unordered_map<std::string, size_t> of_client_ GUARDED(mutex_);  // how many of them
  bool ended_ GUARDED(mutex_) = false;
};

}  // namespace sightline
