// The JSON of a glTF file, looked through before tinygltf sees it. tinygltf 2.7 recurses on nested values,
// skips what it cannot parse, narrows integers silently and opens any path; so every key that we read is
// checked here, and tinygltf is given a copy that holds those keys only.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "server/base/error.h"
#include "server/scene/gltf.h"

namespace sightline {

// Parses without recursion, after a first pass that builds nothing has counted depth and values.
Result<nlohmann::json> parse_gltf_json(std::string_view text, const GltfLimits& limits);

// Types, lengths and references: after success every index in the document points at something that exists
// and every number that we read is finite and within an int. Also version and required extensions
// (kUnsupported, naming it).
Status check_gltf_json(const nlohmann::json& document, const GltfLimits& limits);

// tinygltf refuses indices whose accessor has no buffer view, which a sparse one need not have; so they
// travel among the attributes, under this name.
inline constexpr const char* kIndicesAttribute = "#indices";

// The checked keys and no others: no images, no URIs, no extras, no extensions except EXT_mesh_gpu_instancing and
// KHR_draco_mesh_compression.
nlohmann::json reduce_gltf_json(const nlohmann::json& document);

}  // namespace sightline
