// RPC ListScenes: the names that a session can be opened with.
#pragma once

#include <grpcpp/support/server_callback.h>

#include "server/receive/parts.h"
#include "sightline/v1/scene.pb.h"

namespace sightline {

inline constexpr size_t kMaxListedScenes = 1000;

grpc::ServerUnaryReactor* list_scenes(grpc::CallbackServerContext* context, const ServiceParts& parts,
                                      v1::ListScenesReply& reply);

}  // namespace sightline
