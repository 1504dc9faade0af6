#include "server/service/service.h"

#include <exception>
#include <new>

#include "server/service/control_stream.h"
#include "server/service/list_scenes.h"
#include "server/service/list_sessions.h"
#include "server/service/server_info.h"
#include "server/service/upload_scene.h"

namespace sightline {
namespace {

// Without this, gRPC would answer UNKNOWN when memory runs out.
template <typename Handler>
grpc::Status guarded(const Log& log, const char* rpc, const Handler& handler) try {
  return handler();
} catch (const std::bad_alloc&) {
  log.error("call failed", {{"rpc", rpc}, {"reason", "out of memory"}});
  return {grpc::StatusCode::RESOURCE_EXHAUSTED, "the server is out of memory"};
} catch (const std::exception& trouble) {
  log.error("call failed", {{"rpc", rpc}, {"reason", trouble.what()}});
  return {grpc::StatusCode::INTERNAL, "the call failed; the server's log says why"};
}

}  // namespace

void CameraControlService::take_calls(EventLoop& loop) {
  using Incoming = ControlStream::Incoming;
  const auto ask = [&](Incoming& incoming, void* tag) {
    // As the generated RequestControl, which would parse the messages. Control is the first method of the service.
    RequestAsyncBidiStreaming(0, &incoming.context, &incoming.responder, &loop.queue(), &loop.server_queue(), tag);
  };
  CallAcceptor<Incoming>::start(loop, ask, [this, &loop](std::unique_ptr<Incoming> incoming) {
    take_calls(loop);
    const auto caller = callers_.identify(incoming->context, Need::kControl);
    ControlStream::start(parts_, limits_, helpers_, loop, std::move(incoming),
                         parts_.id_prefix + "-" + std::to_string(++calls_), caller);
  });
}

grpc::Status CameraControlService::UploadScene(grpc::ServerContext* context,
                                               grpc::ServerReader<v1::UploadSceneRequest>* reader,
                                               v1::UploadSceneResponse* reply) {
  return guarded(parts_.log, "UploadScene", [&] {
    const auto caller = callers_.identify(*context, Need::kControl);
    return caller ? upload_scene(*context, *reader, parts_, limits_, timers_, uploads_, caller->name, *reply)
                  : caller.error();
  });
}

grpc::Status CameraControlService::ListScenes(grpc::ServerContext* context, const v1::ListScenesRequest* request,
                                              v1::ListScenesResponse* response) {
  return guarded(parts_.log, "ListScenes", [&] {
    const auto caller = callers_.identify(*context, Need::kAnyRole);
    return caller ? list_scenes(parts_.scenes, *request, *response) : caller.error();
  });
}

grpc::Status CameraControlService::GetServerInfo(grpc::ServerContext* context, const v1::GetServerInfoRequest*,
                                                 v1::GetServerInfoResponse* info) {
  return guarded(parts_.log, "GetServerInfo", [&] {
    const auto caller = callers_.identify(*context, Need::kAnyRole);
    if (!caller) return caller.error();
    get_server_info(parts_, *info);
    return grpc::Status::OK;
  });
}

grpc::Status CameraControlService::GetServerStats(grpc::ServerContext* context, const v1::GetServerStatsRequest*,
                                                  v1::GetServerStatsResponse* stats) {
  return guarded(parts_.log, "GetServerStats", [&] {
    const auto caller = callers_.identify(*context, Need::kObserve);
    if (!caller) return caller.error();
    get_server_stats(parts_, callers_, *stats);
    stats->set_ready(ready_());
    return grpc::Status::OK;
  });
}

grpc::Status CameraControlService::ListSessions(grpc::ServerContext* context, const v1::ListSessionsRequest* request,
                                                v1::ListSessionsResponse* response) {
  return guarded(parts_.log, "ListSessions", [&] {
    const auto caller = callers_.identify(*context, Need::kObserve);
    return caller ? list_sessions(parts_.sessions, parts_.id_prefix, parts_.clock(), *request, *response)
                  : caller.error();
  });
}

}  // namespace sightline
