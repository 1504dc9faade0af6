// Buffer views that were packed by meshoptimizer (EXT_meshopt_compression): unpacked once, before any accessor is read.
#pragma once

#include <nlohmann/json.hpp>
#include <vector>

#include "server/scene/gltf_document.h"

namespace sightline {

inline constexpr const char* kMeshoptExtension = "EXT_meshopt_compression";

// Which buffers hold nothing but what the extension's own streams hold too: every view into them is packed, and no
// stream lies in them. They need no bytes behind them, and those that are there are not read. `json` has passed
// check_gltf_json.
std::vector<bool> meshopt_fallback_buffers(const nlohmann::json& json);

// Fills document.unpacked_views for the packed views that a mesh, an instancing node or an animation needs; others
// (normals, texture coordinates) are left alone. `json` has passed check_gltf_json, document.buffers are loaded.
// kDataLoss for a damaged stream, kResourceExhausted for more bytes than the budget has left, both with the field
// "bufferViews[i].extensions.EXT_meshopt_compression". Nothing is allocated for more elements than the stream's
// length can hold.
Status unpack_meshopt_views(const nlohmann::json& json, GltfDocument& document);

}  // namespace sightline
