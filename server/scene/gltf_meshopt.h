// Buffer views that are packed by meshoptimizer (EXT_meshopt_compression and KHR_meshopt_compression). A view is
// unpacked when an accessor first reads it, so that normals and texture coordinates, which nothing reads, stay packed.
// All JSON here has passed check_gltf_json.
//
// The two extensions differ by what KHR adds: version 1 of the attribute codec and the filter COLOR. meshoptimizer 0.18
// has neither.
#pragma once

#include <array>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "server/scene/gltf_document.h"

namespace sightline {

inline constexpr std::array<const char*, 2> kMeshoptExtensions = {"EXT_meshopt_compression", "KHR_meshopt_compression"};

// How a buffer view is packed.
struct MeshoptPacking {
  const char* extension = nullptr;          // one of kMeshoptExtensions
  const nlohmann::json* members = nullptr;  // its object
};
// None where the view is not packed.
std::optional<MeshoptPacking> meshopt_packing(const nlohmann::json& view);

// Which buffers are fallbacks: every view into them is packed, and no stream lies in them. They need no bytes behind
// them, and bytes that are there are not read.
std::vector<bool> meshopt_fallback_buffers(const nlohmann::json& json);

// The bytes of a packed view, kept in document.unpacked_views. Needs document.buffers. kDataLoss for a damaged stream,
// kUnsupported for what meshoptimizer lacks, kResourceExhausted for more bytes than the budget has left, all with the
// field "bufferViews[i].extensions.EXT_meshopt_compression", or that of the other extension. Nothing is allocated for
// more elements than the stream's length can hold.
Result<std::span<const std::byte>> unpack_meshopt_view(GltfDocument& document, size_t view,
                                                       const MeshoptPacking& packing);

}  // namespace sightline
