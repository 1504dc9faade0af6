// Checks the JSON of a glTF file before tinygltf sees it, because tinygltf 2.7 recurses on nested values, skips what it
// cannot parse, narrows integers silently and opens any path. So each member that the reader uses is checked here,
// once, by one table (gltf_check.cpp), and tinygltf gets a copy that holds the checked members and no others.
#pragma once

#include <nlohmann/json.hpp>
#include <string_view>

#include "server/base/error.h"
#include "server/scene/gltf.h"

namespace sightline {

// Parses without recursion, in a time that grows with the length alone; stops at the first value beyond the limits of
// depth, number and length, and when limits.work ends.
Result<nlohmann::json> parse_gltf_json(std::string_view text, const GltfLimits& limits);

// Checks types, lengths and references. After success every index in the document refers to something that exists.
// Every number that the reader uses is finite and in range. A version (`version`, `minVersion`) other than 2.x and a
// required extension that is not supported are kUnsupported. Returns the copy for tinygltf: no buffers, images, URIs or
// extras, and of the extensions only those that describe geometry.
Result<nlohmann::json> check_gltf_json(const nlohmann::json& document, const GltfLimits& limits);

// The words that an accessor's `type` may be. Another one is no error until something reads the accessor: it may belong
// to an extension. The copy has "SCALAR" in its place.
bool is_gltf_accessor_type(std::string_view type);

// tinygltf refuses indices whose accessor has no buffer view, which a sparse one need not have; so the copy lists them
// among the attributes, under this name.
inline constexpr const char* kIndicesAttribute = "#indices";

}  // namespace sightline
