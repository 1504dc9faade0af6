// The bytes of a document's buffers, from the binary chunk, data URIs and other files.
#pragma once

#include <nlohmann/json.hpp>

#include "server/scene/gltf.h"
#include "server/scene/gltf_container.h"

namespace sightline {

struct GltfDocument;

// The path that a URI of a document names: percent-decoded once, relative, without "..", without a scheme,
// without control characters or backslashes. Anything else is kInvalidArgument with the given field.
Result<std::string> relative_path_of_uri(const std::string& uri, const std::string& field);

// Fills document.buffers, .absent_buffers, .owned and .external_hashes from document.json. Each buffer is exactly its
// byteLength; a source that is shorter is kDataLoss. A fallback buffer (gltf_meshopt.h) is left empty. All buffers
// together stay below limits.max_file_bytes.
//
// A buffer without a source, or with a URI that names none, is absent: kInvalidArgument, kNotFound or kDataLoss with
// the field "buffers[i].uri" for whoever reads from it.
Status load_gltf_buffers(const GltfContainer& container, const ExternalFile& external, const GltfLimits& limits,
                         GltfDocument& document);

}  // namespace sightline
