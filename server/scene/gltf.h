// Reads glTF 2.0 (.gltf with files or data URIs, .glb) into a SceneAsset. Input is untrusted: JSON depth and
// sizes are checked before tinygltf sees a byte, every accessor range is validated, cycles and deep
// hierarchies are refused, images are never decoded. Every failure is an Error whose field is a JSON path
// such as "meshes[0].primitives[1].indices".
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "server/scene/asset.h"

namespace sightline {

// Ceilings of one file; exceeding one is kResourceExhausted and names it.
struct GltfLimits {
  size_t max_file_bytes = size_t{1} << 30;
  size_t max_triangles = 50'000'000;  // stored, not instanced
  size_t max_instances = 1'000'000;
  size_t max_nodes = 1'000'000;
  int max_node_depth = 64;
  int max_json_depth = 64;
  size_t max_json_bytes = size_t{128} << 20;
  size_t max_json_values = 16'000'000;
  size_t max_animation_values = 50'000'000;  // numbers in all keys of all animations
  // What packed parts (EXT_meshopt_compression, KHR_draco_mesh_compression) may need while they are unpacked, all of a
  // file together.
  size_t max_unpacked_bytes = size_t{4} << 30;
};

// Returns the bytes of a file that the document refers to by relative URI (already percent-decoded, never
// containing
// ".." and never absolute), or an Error. Pass nullptr when external files are not allowed (uploads): then a
// reference to one is an error that names it.
using ExternalFile = std::function<Result<std::vector<std::byte>>(const std::string& relative_path)>;

// `bytes` is the whole .glb or .gltf (told apart by the magic). Thread-safe; may run for seconds on large
// files.
Result<std::shared_ptr<const SceneAsset>> read_gltf(std::span<const std::byte> bytes,
                                                    const ExternalFile& external, GeometryStore& store,
                                                    const GltfLimits& limits = {});

// Convenience for command-line tools: reads `path` and lets it refer to files beside or below itself.
Result<std::shared_ptr<const SceneAsset>> read_gltf_file(const std::string& path, GeometryStore& store,
                                                         const GltfLimits& limits = {});

}  // namespace sightline
