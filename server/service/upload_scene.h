// RPC UploadScene: a scene file in chunks.
#pragma once

#include <grpcpp/server_context.h>
#include <grpcpp/support/sync_stream.h>

#include <atomic>
#include <cstddef>

#include "server/service/parts.h"
#include "sightline/v1/scene.pb.h"

namespace sightline {

// Collects the chunks, then reads the file on a loader's thread. Blocks until that is done.
//
// `open_uploads` counts the calls in progress. Beyond limits.max_uploads a call is refused with RESOURCE_EXHAUSTED and a
// retry time. A chunk or file that is too large is refused without a retry time. A call whose client sends nothing for
// limits.upload_timeout ends as CANCELLED.
grpc::Status upload_scene(grpc::ServerContext& context, grpc::ServerReader<v1::UploadSceneRequest>& reader,
                          const ServiceParts& parts, const ServiceLimits& limits,
                          std::atomic<size_t>& open_uploads, v1::UploadSceneResponse& reply);

}  // namespace sightline
