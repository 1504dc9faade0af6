#include "server/service/upload_scene.h"

#include <grpcpp/impl/codegen/proto_utils.h>

#include <atomic>
#include <exception>
#include <new>
#include <optional>
#include <semaphore>
#include <span>
#include <vector>

#include "server/service/read_timeout.h"
#include "server/wire/error_to_proto.h"

namespace sightline {
namespace {

constexpr std::chrono::seconds kRetryDelay{2};
// While the file is read, the call looks so often whether its client still waits.
constexpr std::chrono::milliseconds kLookEvery{20};

grpc::Status too_large(LimitCounts& counts, const std::string& what, size_t limit_bytes, const char* flag) {
  counts.hit(Limit::kMaxUpload);
  return status_from_error({ErrorCode::kResourceExhausted, "chunk",
                            what + " is larger than " + std::to_string(limit_bytes) + " bytes" + flag});
}

grpc::Status collect(grpc::ServerReader<v1::UploadSceneRequest>& reader, const ServiceLimits& limits,
                     LimitCounts& counts, ReadTimeout& timeout, UploadPlaces::Place& place,
                     std::vector<std::byte>& bytes) {
  v1::UploadSceneRequest request;
  const auto next = [&] {
    timeout.begin();
    const bool more = reader.Read(&request);
    timeout.end();
    return more;
  };
  while (next()) {
    const auto chunk = std::as_bytes(std::span(request.chunk()));
    if (chunk.size() > limits.max_chunk_bytes)
      return too_large(counts, "a chunk", limits.max_chunk_bytes, ", which is fixed");
    if (bytes.size() + chunk.size() > limits.max_upload_bytes)
      return too_large(counts, "the file", limits.max_upload_bytes, " (--max-upload-mib)");
    if (!place.add(chunk.size())) {
      counts.hit(Limit::kMaxUpload);
      return exhausted_status("the uploads in progress hold too much memory (twice --max-upload-mib)", kRetryDelay);
    }
    if (place.late()) {
      counts.hit(Limit::kMaxUploads);
      return {grpc::StatusCode::DEADLINE_EXCEEDED,
              "the upload is too slow: it held one of the places of --max-uploads for too long"};
    }
    bytes.insert(bytes.end(), chunk.begin(), chunk.end());
  }
  return grpc::Status::OK;
}

grpc::Status load(const ServiceParts& parts, std::span<const std::byte> bytes, const std::string& client,
                  WorkLimit& work, v1::UploadSceneResponse& reply) try {
  const auto asset = parts.scenes.add_uploaded(bytes, client, &work);
  if (!asset) {
    if (const auto limit = limit_of(asset.error())) parts.stats.limits.hit(*limit);
    parts.log.info("upload refused", {{"reason", to_string(asset.error())}});
    return status_from_error(asset.error());
  }
  reply.set_hash(to_hex((*asset)->hash));
  reply.set_triangle_count((*asset)->triangle_count());
  for (const std::string& warning : (*asset)->warnings) reply.add_warnings(warning);
  parts.log.info("scene uploaded", {{"hash", reply.hash()}, {"bytes", std::to_string(bytes.size())}});
  return grpc::Status::OK;
} catch (const std::bad_alloc&) {
  return {grpc::StatusCode::RESOURCE_EXHAUSTED, "out of memory while reading the scene"};
} catch (const std::exception& trouble) {
  parts.log.error("upload failed", {{"reason", trouble.what()}});
  return {grpc::StatusCode::INTERNAL, "the file could not be read; the server's log says why"};
}

// Reads the file on an uploader's thread.
grpc::Status load_apart(grpc::ServerContext& context, const ServiceParts& parts, std::span<const std::byte> bytes,
                        const std::string& client, v1::UploadSceneResponse& reply) {
  std::atomic<bool> unwanted{false};
  WorkLimit work(parts.load, [&unwanted] { return unwanted.load(); });
  grpc::Status status;
  std::binary_semaphore loaded(0);
  parts.uploaders.post(
      [&] {
        status = unwanted ? grpc::Status::CANCELLED : load(parts, bytes, client, work, reply);
        loaded.release();
      },
      client);
  while (!loaded.try_acquire_for(kLookEvery))
    if (context.IsCancelled()) unwanted = true;
  return unwanted ? grpc::Status::CANCELLED : status;
}

}  // namespace

grpc::Status upload_scene(grpc::ServerContext& context, grpc::ServerReader<v1::UploadSceneRequest>& reader,
                          const ServiceParts& parts, const ServiceLimits& limits, Timers& timers, UploadPlaces& places,
                          const std::string& client, v1::UploadSceneResponse& reply) {
  std::optional<UploadPlaces::Place> place;
  places.take(place, client, [&context] { context.TryCancel(); });
  LimitCounts& counts = parts.stats.limits;
  if (!place && places.ended()) return {grpc::StatusCode::UNAVAILABLE, "the server is shutting down"};
  if (!place) {
    counts.hit(Limit::kMaxUploads);
    return exhausted_status("too many uploads are in progress, " + std::to_string(places.max_of_client()) +
                                " at most of one client (--max-uploads)",
                            kRetryDelay);
  }
  std::vector<std::byte> bytes;
  ReadTimeout timeout(timers, context, limits.upload_timeout);
  if (grpc::Status status = collect(reader, limits, counts, timeout, *place, bytes); !status.ok()) return status;
  if (timeout.ran_out()) {
    counts.hit(Limit::kUploadTimeout);
    parts.log.info("upload ended", {{"reason", "the client sent nothing for --upload-timeout-s"},
                                    {"bytes", std::to_string(bytes.size())}});
  }
  if (!place->complete()) {
    if (places.ended()) return {grpc::StatusCode::UNAVAILABLE, "the server is shutting down"};
    counts.hit(Limit::kMaxUploads);
    parts.log.info("upload ended",
                   {{"reason", "it was too slow, and another one needed its place"}, {"client", client}});
    return grpc::Status::CANCELLED;
  }
  // The first part of a file can be a valid file by itself, so an upload that was cut short is not read.
  if (timeout.ran_out() || context.IsCancelled()) return grpc::Status::CANCELLED;
  return load_apart(context, parts, bytes, client, reply);
}

}  // namespace sightline
