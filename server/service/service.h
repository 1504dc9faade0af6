// The gRPC service: it assigns every RPC to its handler.
//
// Control carries the sessions and is asynchronous: event loops move its messages. The other RPCs are rare, and each
// occupies one of gRPC's threads while it runs.
#pragma once

#include <atomic>
#include <string>
#include <utility>

#include "server/gate/gate.h"
#include "server/rpc/event_loop.h"
#include "server/rpc/timers.h"
#include "server/service/callers.h"
#include "server/service/control_stream.h"
#include "server/service/parts.h"
#include "server/service/upload_places.h"
#include "sightline/v1/camera_control.grpc.pb.h"

namespace sightline {

// Thread-safe, as gRPC requires. `parts` must outlive it, and it must outlive the gRPC server and the loops.
class CameraControlService final
    : public v1::CameraControlService::WithAsyncMethod_Control<v1::CameraControlService::Service> {
 public:
  CameraControlService(ServiceParts parts, const ServiceLimits& limits)
      : parts_(std::move(parts)), limits_(limits), uploads_(limits.max_uploads, 2 * limits.max_upload_bytes) {}

  // Decides who may call. The listener tells it about the gate.
  Callers& callers() { return callers_; }
  // For the services beside this one.
  Timers& timers() { return timers_; }
  // How often limits refused something, for the services beside this one.
  LimitCounts& limit_counts() { return parts_.stats.limits; }
  // Whether the daemon is ready, for its own statistics; until then it is. Called at most once, before the server
  // starts.
  void tell_ready_by(std::function<bool()> ready) { ready_ = std::move(ready); }

  // Ends all uploads: the server is shutting down.
  void end_uploads() { uploads_.end_all(); }

  // Lets `loop` take calls of Control, from now until the server shuts down. Called once for each loop, after the
  // server has started.
  void take_calls(EventLoop& loop);

  grpc::Status UploadScene(grpc::ServerContext* context, grpc::ServerReader<v1::UploadSceneRequest>* reader,
                           v1::UploadSceneResponse* reply) override;
  grpc::Status ListScenes(grpc::ServerContext* context, const v1::ListScenesRequest* request,
                          v1::ListScenesResponse* reply) override;
  grpc::Status GetServerInfo(grpc::ServerContext* context, const v1::GetServerInfoRequest* request,
                             v1::GetServerInfoResponse* info) override;
  grpc::Status GetServerStats(grpc::ServerContext* context, const v1::GetServerStatsRequest* request,
                              v1::GetServerStatsResponse* stats) override;
  grpc::Status ListSessions(grpc::ServerContext* context, const v1::ListSessionsRequest* request,
                            v1::ListSessionsResponse* response) override;

 private:
  const ServiceParts parts_;
  const ServiceLimits limits_;
  const Credentials no_credentials_;
  Callers callers_{parts_.credentials ? *parts_.credentials : no_credentials_};
  KeptSessions kept_{limits_.resume_grace, parts_.streams, parts_.stats, parts_.log};
  WorkerPool parsers_{1};   // of large messages
  WorkerPool claimers_{1};  // of sessions to resume
  MessageMemory messages_{limits_.messages_memory};
  Timers timers_;
  const StreamHelpers helpers_{parsers_, claimers_, messages_, kept_, timers_};
  std::atomic<uint64_t> calls_{0};  // Control calls so far; numbers the sessions
  UploadPlaces uploads_;
  std::function<bool()> ready_ = [] { return true; };
};

}  // namespace sightline
