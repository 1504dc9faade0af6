// RPC UploadScene: a scene file in chunks.
#pragma once

#include <grpcpp/server_context.h>
#include <grpcpp/support/sync_stream.h>

#include <string>

#include "server/rpc/timers.h"
#include "server/service/parts.h"
#include "server/service/upload_places.h"
#include "sightline/v1/scene.pb.h"

namespace sightline {

// Collects the chunks, then reads the file on an uploader's thread. Blocks until that is done, or the call ends: the
// reading ends then too.
//
// A call without a place is refused with RESOURCE_EXHAUSTED and a retry time, and so is one that would take too much
// memory beside the others. A chunk or file that is too large is refused without a retry time. A call whose client
// sends nothing for limits.upload_timeout, or that loses its place, ends as CANCELLED. `client` is the client's name.
grpc::Status upload_scene(grpc::ServerContext& context, grpc::ServerReader<v1::UploadSceneRequest>& reader,
                          const ServiceParts& parts, const ServiceLimits& limits, Timers& timers, UploadPlaces& places,
                          const std::string& client, v1::UploadSceneResponse& reply);

}  // namespace sightline
