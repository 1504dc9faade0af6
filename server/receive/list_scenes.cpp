#include "server/receive/list_scenes.h"

#include <grpcpp/server_context.h>

namespace sightline {

grpc::ServerUnaryReactor* list_scenes(grpc::CallbackServerContext* context, const ServiceParts& parts,
                                      v1::ListScenesReply& reply) {
  grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
  // A folder may be on a slow disk, and gRPC's threads take steps.
  parts.loaders.post([reactor, &parts, &reply] {
    for (std::string& name : parts.scenes.names(kMaxListedScenes)) reply.add_names(std::move(name));
    reactor->Finish(grpc::Status::OK);
  });
  return reactor;
}

}  // namespace sightline
