// The outermost layer of a glTF file: which bytes are JSON and which are the binary chunk (glTF 2.0
// section 4.4).
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string_view>

#include "server/base/error.h"

namespace sightline {

// Views into the bytes that were split; valid as long as those are.
struct GltfContainer {
  std::string_view json;
  std::optional<std::span<const std::byte>> binary_chunk;  // absent in a .gltf and in a .glb without BIN
};

// Told apart by the magic "glTF". A .glb whose header or chunks promise more than `bytes` holds is kDataLoss
// (fields "glb.header", "glb.chunks[i]"). Chunks of unknown type are skipped, bytes after the stated length
// ignored.
Result<GltfContainer> split_gltf_container(std::span<const std::byte> bytes);

}  // namespace sightline
