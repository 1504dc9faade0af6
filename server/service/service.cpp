#include "server/service/service.h"

#include "server/service/control_stream.h"
#include "server/service/list_scenes.h"
#include "server/service/server_info.h"
#include "server/service/upload_scene.h"

namespace sightline {

void CameraControlService::take_calls(EventLoop& loop) {
  using Incoming = ControlStream::Incoming;
  const auto ask = [&](Incoming& incoming, void* tag) {
    RequestControl(&incoming.context, &incoming.responder, &loop.queue(), &loop.server_queue(), tag);
  };
  CallAcceptor<Incoming>::start(loop, ask, [this, &loop](std::unique_ptr<Incoming> incoming) {
    take_calls(loop);
    ControlStream::start(parts_, limits_, loop, std::move(incoming),
                         parts_.id_prefix + "-" + std::to_string(++calls_));
  });
}

grpc::Status CameraControlService::UploadScene(grpc::ServerContext* context,
                                               grpc::ServerReader<v1::UploadSceneRequest>* reader,
                                               v1::UploadSceneResponse* reply) {
  return upload_scene(*context, *reader, parts_, limits_, open_uploads_, *reply);
}

grpc::Status CameraControlService::ListScenes(grpc::ServerContext*, const v1::ListScenesRequest* request,
                                              v1::ListScenesResponse* response) {
  return list_scenes(parts_.scenes, *request, *response);
}

grpc::Status CameraControlService::GetServerInfo(grpc::ServerContext*, const v1::GetServerInfoRequest*,
                                                 v1::GetServerInfoResponse* info) {
  get_server_info(parts_, *info);
  return grpc::Status::OK;
}

grpc::Status CameraControlService::GetServerStats(grpc::ServerContext*, const v1::GetServerStatsRequest*,
                                                  v1::GetServerStatsResponse* stats) {
  get_server_stats(parts_, *stats);
  return grpc::Status::OK;
}

}  // namespace sightline
