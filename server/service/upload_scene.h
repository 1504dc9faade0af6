// RPC UploadScene: a scene file in chunks.
#pragma once

#include <grpcpp/server_context.h>
#include <grpcpp/support/sync_stream.h>

#include <atomic>
#include <cstddef>

#include "server/service/parts.h"
#include "sightline/v1/scene.pb.h"

namespace sightline {

// Collects chunks, then reads the file on a loader's thread. Blocks until that is done.
//
// `open_uploads` counts the calls in progress. Over limits.max_uploads the call is refused with RESOURCE_EXHAUSTED and a retry
// time; so is a chunk or a file that is too large, without one. One whose client sends nothing for limits.upload_timeout ends as
// CANCELLED and gives its place back.
grpc::Status upload_scene(grpc::ServerContext& context, grpc::ServerReader<v1::UploadSceneRequest>& reader,
                          const ServiceParts& parts, const ServiceLimits& limits,
                          std::atomic<size_t>& open_uploads, v1::UploadSceneResponse& reply);

}  // namespace sightline
