// The service: which handler takes which RPC.
#pragma once

#include <atomic>

#include "server/receive/parts.h"
#include "sightline/v1/camera_control.grpc.pb.h"

namespace sightline {

// Thread-safe, as gRPC asks. `parts` must outlive it, and it must outlive the gRPC server.
class CameraControlService final : public v1::CameraControl::CallbackService {
 public:
  CameraControlService(ServiceParts parts, const ServiceLimits& limits)
      : parts_(std::move(parts)), limits_(limits) {}

  grpc::ServerBidiReactor<v1::ControlRequest, v1::ControlReply>* Control(
      grpc::CallbackServerContext* context) override;
  grpc::ServerReadReactor<v1::UploadSceneRequest>* UploadScene(grpc::CallbackServerContext* context,
                                                               v1::UploadSceneReply* reply) override;
  grpc::ServerUnaryReactor* ListScenes(grpc::CallbackServerContext* context,
                                       const v1::ListScenesRequest* request,
                                       v1::ListScenesReply* reply) override;
  grpc::ServerUnaryReactor* GetServerInfo(grpc::CallbackServerContext* context,
                                          const v1::GetServerInfoRequest* request,
                                          v1::ServerInfo* info) override;

 private:
  const ServiceParts parts_;
  const ServiceLimits limits_;
  std::atomic<uint64_t> calls_{0};  // Control calls so far: numbers the sessions
  std::atomic<size_t> open_uploads_{0};
};

}  // namespace sightline
