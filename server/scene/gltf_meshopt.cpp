#include "server/scene/gltf_meshopt.h"

#include <meshoptimizer.h>

#include <algorithm>
#include <string>

namespace sightline {
namespace {

using nlohmann::json;

constexpr std::byte kAttributeCodec1{0xA1};  // the first byte of its streams
constexpr size_t kTailBytes = 32;            // of the attribute codec, at least

struct Stream {
  std::span<const std::byte> bytes;
  size_t count = 0;
  size_t stride = 0;
  std::string mode;
  std::string filter;

  const unsigned char* data() const { return reinterpret_cast<const unsigned char*>(bytes.data()); }
};

// The length of the shortest stream for the number of elements (appendix A of the extension): two bits for each byte of
// 16 elements, one byte for each triangle, one byte for each index.
size_t shortest_stream(const Stream& stream) {
  if (stream.mode == "TRIANGLES") return 1 + stream.count / 3 + 16;
  if (stream.mode == "INDICES") return 1 + stream.count + 4;
  return 1 + stream.stride * ((stream.count + 63) / 64) + std::max(kTailBytes, stream.stride);
}

bool decode(const Stream& stream, std::vector<std::byte>& out) {
  if (stream.mode == "TRIANGLES")
    return meshopt_decodeIndexBuffer(out.data(), stream.count, stream.stride, stream.data(), stream.bytes.size()) == 0;
  if (stream.mode == "INDICES")
    return meshopt_decodeIndexSequence(out.data(), stream.count, stream.stride, stream.data(), stream.bytes.size()) ==
           0;
  return meshopt_decodeVertexBuffer(out.data(), stream.count, stream.stride, stream.data(), stream.bytes.size()) == 0;
}

void apply_filter(const Stream& stream, std::vector<std::byte>& out) {
  if (stream.filter == "OCTAHEDRAL") meshopt_decodeFilterOct(out.data(), stream.count, stream.stride);
  if (stream.filter == "QUATERNION") meshopt_decodeFilterQuat(out.data(), stream.count, stream.stride);
  if (stream.filter == "EXPONENTIAL") meshopt_decodeFilterExp(out.data(), stream.count, stream.stride);
}

Result<Stream> stream_of(const json& packing, const GltfDocument& document, const std::string& field) {
  const auto buffer = gltf_buffer_bytes(document, packing["buffer"].get<size_t>());
  if (!buffer) return tl::unexpected(buffer.error());
  const size_t offset = packing.value("byteOffset", size_t{0}), length = packing["byteLength"].get<size_t>();
  if (offset > buffer->size() || length > buffer->size() - offset)
    return fail(ErrorCode::kDataLoss, field, "reaches beyond its buffer");
  return Stream{buffer->subspan(offset, length), packing["count"].get<size_t>(), packing["byteStride"].get<size_t>(),
                packing["mode"].get<std::string>(), packing.value("filter", std::string("NONE"))};
}

}  // namespace

std::optional<MeshoptPacking> meshopt_packing(const json& view) {
  const auto extensions = view.find("extensions");
  if (extensions == view.end()) return std::nullopt;
  for (const char* name : kMeshoptExtensions)
    if (const auto members = extensions->find(name); members != extensions->end())
      return MeshoptPacking{name, &*members};
  return std::nullopt;
}

std::vector<bool> meshopt_fallback_buffers(const json& document) {
  if (!document.contains("buffers") || !document.contains("bufferViews")) return {};
  std::vector<bool> covered(document["buffers"].size(), false), needed(covered.size(), false);
  for (const json& view : document["bufferViews"]) {
    const auto packing = meshopt_packing(view);
    (packing ? covered : needed)[view["buffer"].get<size_t>()] = true;
    if (packing) needed[(*packing->members)["buffer"].get<size_t>()] = true;
  }
  for (size_t i = 0; i < covered.size(); ++i) covered[i] = covered[i] && !needed[i];
  return covered;
}

Result<std::span<const std::byte>> unpack_meshopt_view(GltfDocument& document, size_t view,
                                                       const MeshoptPacking& packing) {
  if (const auto done = document.unpacked_views.find(view); done != document.unpacked_views.end()) return done->second;
  const std::string field = gltf_path("bufferViews", view).append(".extensions.").append(packing.extension);
  const auto stream = stream_of(*packing.members, document, field);
  if (!stream) return tl::unexpected(stream.error());
  const auto damaged = fail(ErrorCode::kDataLoss, field, "is damaged: it does not unpack to what the view says");
  if (stream->mode == "ATTRIBUTES" && stream->bytes[0] == kAttributeCodec1)
    return fail(
        ErrorCode::kUnsupported, field,
        "is packed by version 1 of the attribute codec; pack it as EXT_meshopt_compression, which has version 0");
  if (stream->filter == "COLOR") return fail(ErrorCode::kUnsupported, field + ".filter", "COLOR is not supported");
  if (stream->bytes.size() < shortest_stream(*stream)) return damaged;
  const size_t size = stream->count * stream->stride;
  if (const Status s = GltfBudget::take(document.budget.unpacked_bytes, size, field, "unpacked bytes"); !s)
    return tl::unexpected(s.error());
  if (const Status s = go_on(document); !s) return tl::unexpected(s.error());
  std::vector<std::byte> out(size);
  if (!decode(*stream, out)) return damaged;
  apply_filter(*stream, out);
  document.owned.push_back(std::move(out));
  return document.unpacked_views[view] = document.owned.back();
}

}  // namespace sightline
