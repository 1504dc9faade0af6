#include "server/receive/upload_scene.h"

#include <grpcpp/server_context.h>

#include <exception>
#include <new>
#include <span>

#include "server/receive/retry_info.h"
#include "server/reply/error_to_proto.h"

namespace sightline {
namespace {

constexpr std::chrono::seconds kRetryDelay{2};

grpc::Status too_large(const std::string& what, size_t limit_bytes) {
  return status_from_error({ErrorCode::kResourceExhausted, "chunk",
                            what + " is larger than " + std::to_string(limit_bytes) + " bytes"});
}

}  // namespace

UploadScene::UploadScene(grpc::CallbackServerContext& context, const ServiceParts& parts,
                         const ServiceLimits& limits, std::atomic<size_t>& open_uploads,
                         v1::UploadSceneReply& reply)
    : context_(context), parts_(parts), limits_(limits), open_uploads_(open_uploads), reply_(reply) {
  if (++open_uploads_ > limits_.max_uploads) {
    Finish(exhausted_status("too many uploads at the same time", kRetryDelay));
    return;
  }
  StartRead(&request_);
}

UploadScene::~UploadScene() {
  --open_uploads_;
}

grpc::Status UploadScene::check_chunk() const {
  if (request_.chunk().size() > limits_.max_chunk_bytes) return too_large("a chunk", limits_.max_chunk_bytes);
  if (bytes_.size() + request_.chunk().size() > limits_.max_upload_bytes) {
    return too_large("the file", limits_.max_upload_bytes);
  }
  return grpc::Status::OK;
}

void UploadScene::OnReadDone(bool ok) {
  if (context_.IsCancelled()) {
    Finish(grpc::Status::CANCELLED);
    return;
  }
  if (!ok) {  // the client has sent everything
    parts_.loaders.post([this] { load(); });
    return;
  }
  if (grpc::Status status = check_chunk(); !status.ok()) {
    Finish(std::move(status));
    return;
  }
  const auto chunk = std::as_bytes(std::span(request_.chunk()));
  bytes_.insert(bytes_.end(), chunk.begin(), chunk.end());
  StartRead(&request_);
}

void UploadScene::load() try {
  const auto asset = parts_.scenes.add_uploaded(bytes_);
  if (!asset) {
    parts_.log.info("upload refused", {{"reason", to_string(asset.error())}});
    Finish(status_from_error(asset.error()));
    return;
  }
  reply_.set_hash(to_hex((*asset)->hash));
  reply_.set_triangles((*asset)->triangle_count());
  for (const std::string& warning : (*asset)->warnings) reply_.add_warnings(warning);
  parts_.log.info("scene uploaded", {{"hash", reply_.hash()}, {"bytes", std::to_string(bytes_.size())}});
  Finish(grpc::Status::OK);
} catch (const std::bad_alloc&) {
  Finish({grpc::StatusCode::RESOURCE_EXHAUSTED, "out of memory while reading the scene"});
} catch (const std::exception& trouble) {
  parts_.log.error("upload failed", {{"reason", trouble.what()}});
  Finish({grpc::StatusCode::INTERNAL, "the file could not be read; the server's log says why"});
}

}  // namespace sightline
