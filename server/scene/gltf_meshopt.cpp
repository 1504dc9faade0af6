#include "server/scene/gltf_meshopt.h"

#include <meshoptimizer.h>

#include <algorithm>
#include <string>

namespace sightline {
namespace {

using nlohmann::json;

constexpr size_t kTailBytes = 32;  // of the attribute codec, at least

// The extension's object of a view or a buffer, or null.
const json* packed(const json& object) {
  const auto extensions = object.find("extensions");
  if (extensions == object.end()) return nullptr;
  const auto ours = extensions->find(kMeshoptExtension);
  return ours == extensions->end() ? nullptr : &*ours;
}

struct Stream {
  std::span<const std::byte> bytes;
  size_t count = 0;
  size_t stride = 0;
  std::string mode;
  std::string filter;

  const unsigned char* data() const { return reinterpret_cast<const unsigned char*>(bytes.data()); }
};

// What the shortest stream of so many elements takes (appendix A of the extension): two bits for each byte of 16
// elements, a byte for each triangle, a byte for each index.
size_t shortest_stream(const Stream& stream) {
  if (stream.mode == "TRIANGLES") return 1 + stream.count / 3 + 16;
  if (stream.mode == "INDICES") return 1 + stream.count + 4;
  return 1 + stream.stride * ((stream.count + 63) / 64) + std::max(kTailBytes, stream.stride);
}

bool decode(const Stream& stream, std::vector<std::byte>& out) {
  if (stream.mode == "TRIANGLES")
    return meshopt_decodeIndexBuffer(out.data(), stream.count, stream.stride, stream.data(),
                                     stream.bytes.size()) == 0;
  if (stream.mode == "INDICES")
    return meshopt_decodeIndexSequence(out.data(), stream.count, stream.stride, stream.data(),
                                       stream.bytes.size()) == 0;
  return meshopt_decodeVertexBuffer(out.data(), stream.count, stream.stride, stream.data(),
                                    stream.bytes.size()) == 0;
}

void apply_filter(const Stream& stream, std::vector<std::byte>& out) {
  if (stream.filter == "OCTAHEDRAL") meshopt_decodeFilterOct(out.data(), stream.count, stream.stride);
  if (stream.filter == "QUATERNION") meshopt_decodeFilterQuat(out.data(), stream.count, stream.stride);
  if (stream.filter == "EXPONENTIAL") meshopt_decodeFilterExp(out.data(), stream.count, stream.stride);
}

Result<Stream> stream_of(const json& packing, const GltfDocument& document, const std::string& field) {
  const std::span<const std::byte> buffer = document.buffers[packing["buffer"].get<size_t>()];
  const size_t offset = packing.value("byteOffset", size_t{0}), length = packing["byteLength"].get<size_t>();
  if (offset > buffer.size() || length > buffer.size() - offset)
    return fail(ErrorCode::kDataLoss, field, "reaches beyond its buffer");
  return Stream{buffer.subspan(offset, length), packing["count"].get<size_t>(),
                packing["byteStride"].get<size_t>(), packing["mode"].get<std::string>(),
                packing.value("filter", std::string("NONE"))};
}

Status unpack(const json& packing, size_t view, GltfDocument& document) {
  const std::string field = gltf_path("bufferViews", view).append(".extensions.").append(kMeshoptExtension);
  const auto stream = stream_of(packing, document, field);
  if (!stream) return tl::unexpected(stream.error());
  const auto damaged =
      fail(ErrorCode::kDataLoss, field, "is damaged: it does not unpack to what the view says");
  if (stream->bytes.size() < shortest_stream(*stream)) return damaged;
  const size_t size = stream->count * stream->stride;
  if (const Status s = GltfBudget::take(document.budget.unpacked_bytes, size, field, "unpacked bytes"); !s)
    return s;
  std::vector<std::byte> out(size);
  if (!decode(*stream, out)) return damaged;
  apply_filter(*stream, out);
  document.owned.push_back(std::move(out));
  document.unpacked_views[view] = document.owned.back();
  return {};
}

// Marks the views behind accessors that the reader will read.
class NeededViews {
 public:
  explicit NeededViews(const json& document) : document_(document) {
    if (const auto views = document.find("bufferViews"); views != document.end())
      needed_.resize(views->size());
    each(document, "meshes", [this](const json& mesh) {
      each(mesh, "primitives", [this](const json& primitive) {
        accessor_at(primitive["attributes"], "POSITION");
        accessor_at(primitive, "indices");
      });
    });
    each(document, "nodes", [this](const json& node) { instancing(node); });
    each(document, "animations", [this](const json& animation) {
      each(animation, "samplers", [this](const json& sampler) {
        accessor_at(sampler, "input");
        accessor_at(sampler, "output");
      });
    });
  }
  bool operator()(size_t view) const { return needed_[view]; }

 private:
  template <typename Visit>
  static void each(const json& parent, const char* key, Visit visit) {
    if (const auto items = parent.find(key); items != parent.end())
      for (const json& item : *items) visit(item);
  }
  void view_at(const json& parent) {
    if (const auto view = parent.find("bufferView"); view != parent.end())
      needed_[view->get<size_t>()] = true;
  }
  void accessor_at(const json& parent, const char* key) {
    const auto index = parent.find(key);
    if (index == parent.end()) return;
    const json& accessor = document_["accessors"][index->get<size_t>()];
    view_at(accessor);
    const auto sparse = accessor.find("sparse");
    if (sparse == accessor.end()) return;
    view_at((*sparse)["indices"]);
    view_at((*sparse)["values"]);
  }
  void instancing(const json& node) {
    const auto extensions = node.find("extensions");
    if (extensions == node.end() || !extensions->contains("EXT_mesh_gpu_instancing")) return;
    const json& attributes = (*extensions)["EXT_mesh_gpu_instancing"]["attributes"];
    for (const char* name : {"TRANSLATION", "ROTATION", "SCALE"}) accessor_at(attributes, name);
  }

  const json& document_;
  std::vector<bool> needed_;
};

}  // namespace

std::vector<bool> meshopt_fallback_buffers(const json& document) {
  if (!document.contains("buffers") || !document.contains("bufferViews")) return {};
  std::vector<bool> covered(document["buffers"].size(), false), needed(covered.size(), false);
  for (const json& view : document["bufferViews"]) {
    const json* packing = packed(view);
    (packing ? covered : needed)[view["buffer"].get<size_t>()] = true;
    if (packing) needed[(*packing)["buffer"].get<size_t>()] = true;
  }
  for (size_t i = 0; i < covered.size(); ++i) covered[i] = covered[i] && !needed[i];
  return covered;
}

Status unpack_meshopt_views(const json& json, GltfDocument& document) {
  if (!json.contains("bufferViews")) return {};
  const auto& views = json["bufferViews"];
  document.unpacked_views.resize(views.size());
  const NeededViews is_needed(json);
  for (size_t i = 0; i < views.size(); ++i) {
    const auto* packing = is_needed(i) ? packed(views[i]) : nullptr;
    if (!packing) continue;
    if (const Status s = unpack(*packing, i, document); !s) return s;
  }
  return {};
}

}  // namespace sightline
