#include "server/receive/list_scenes.h"

#include <grpcpp/server_context.h>

namespace sightline {

grpc::ServerUnaryReactor* list_scenes(grpc::CallbackServerContext* context, const ServiceParts& parts,
                                      v1::ListScenesReply& reply) {
  for (std::string& name : parts.scenes.names(kMaxListedScenes)) reply.add_names(std::move(name));
  grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
  reactor->Finish(grpc::Status::OK);
  return reactor;
}

}  // namespace sightline
