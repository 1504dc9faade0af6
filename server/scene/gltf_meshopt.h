// Buffer views that are packed by meshoptimizer (EXT_meshopt_compression). A view is unpacked when an accessor first
// reads it, so that normals and texture coordinates, which nothing reads, stay packed. All JSON here has passed
// check_gltf_json.
#pragma once

#include <nlohmann/json.hpp>
#include <vector>

#include "server/scene/gltf_document.h"

namespace sightline {

inline constexpr const char* kMeshoptExtension = "EXT_meshopt_compression";

// The extension's object of a buffer view, or null.
const nlohmann::json* meshopt_packing(const nlohmann::json& view);

// Which buffers are fallbacks: every view into them is packed, and no stream lies in them. They need no bytes behind
// them, and bytes that are there are not read.
std::vector<bool> meshopt_fallback_buffers(const nlohmann::json& json);

// The bytes of a packed view, kept in document.unpacked_views. Needs document.buffers. kDataLoss for a damaged stream,
// kResourceExhausted for more bytes than the budget has left, both with the field
// "bufferViews[i].extensions.EXT_meshopt_compression". Nothing is allocated for more elements than the stream's length
// can hold.
Result<std::span<const std::byte>> unpack_meshopt_view(GltfDocument& document, size_t view,
                                                       const nlohmann::json& packing);

}  // namespace sightline
