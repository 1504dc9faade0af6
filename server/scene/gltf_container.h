// Splits a glTF file into its JSON and its binary chunk (glTF 2.0 section 4.4).
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

// Bytes that begin with "glTF" are a .glb, others a .gltf. A .glb whose header or chunks are longer than `bytes` is
// kDataLoss (fields "glb.header", "glb.chunks[i]"). Chunks of unknown type and bytes after the stated length are
// ignored.
Result<GltfContainer> split_gltf_container(std::span<const std::byte> bytes);

}  // namespace sightline
