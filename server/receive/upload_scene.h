// RPC UploadScene: a scene file in chunks.
#pragma once

#include <grpcpp/support/server_callback.h>

#include <atomic>
#include <cstddef>
#include <vector>

#include "server/receive/parts.h"
#include "sightline/v1/scene.pb.h"

namespace sightline {

// Collects chunks, then reads the file on a loader thread. Deletes itself when gRPC is done with it.
//
// Threads: reactions of one call follow one another, because there is one operation at a time (read, read,
// ..., work, finish); OnCancel alone may run beside them, and is not used: a cancelled call fails its pending
// read.
class UploadScene final : public grpc::ServerReadReactor<v1::UploadSceneRequest> {
 public:
  // `open_uploads` counts the calls in progress and must outlive the server. Over limits.max_uploads the call
  // is refused with RESOURCE_EXHAUSTED and a retry time; so is a chunk or a file that is too large, without
  // one.
  UploadScene(grpc::CallbackServerContext& context, const ServiceParts& parts, const ServiceLimits& limits,
              std::atomic<size_t>& open_uploads, v1::UploadSceneReply& reply);

 private:
  ~UploadScene() override;
  void OnReadDone(bool ok) override;
  void OnDone() override { delete this; }
  grpc::Status check_chunk() const;
  void load();

  grpc::CallbackServerContext& context_;
  const ServiceParts& parts_;
  const ServiceLimits& limits_;
  std::atomic<size_t>& open_uploads_;
  v1::UploadSceneReply& reply_;
  v1::UploadSceneRequest request_;
  std::vector<std::byte> bytes_;
};

}  // namespace sightline
