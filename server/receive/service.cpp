#include "server/receive/service.h"

#include "server/receive/control_stream.h"
#include "server/receive/list_scenes.h"
#include "server/receive/server_info.h"
#include "server/receive/upload_scene.h"

namespace sightline {

grpc::ServerBidiReactor<v1::ControlRequest, v1::ControlReply>* CameraControlService::Control(
    grpc::CallbackServerContext*) {
  return ControlStream::start(parts_, limits_, parts_.id_prefix + "-" + std::to_string(++calls_));
}

grpc::ServerReadReactor<v1::UploadSceneRequest>* CameraControlService::UploadScene(
    grpc::CallbackServerContext* context, v1::UploadSceneReply* reply) {
  return new class UploadScene(*context, parts_, limits_, open_uploads_, *reply);
}

grpc::ServerUnaryReactor* CameraControlService::ListScenes(grpc::CallbackServerContext* context,
                                                           const v1::ListScenesRequest*,
                                                           v1::ListScenesReply* reply) {
  return list_scenes(context, parts_, *reply);
}

grpc::ServerUnaryReactor* CameraControlService::GetServerInfo(grpc::CallbackServerContext* context,
                                                              const v1::GetServerInfoRequest*,
                                                              v1::ServerInfo* info) {
  return get_server_info(context, parts_, *info);
}

}  // namespace sightline
