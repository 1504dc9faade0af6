// Reads glTF 2.0 (.gltf with files or data URIs, .glb) into a SceneAsset. Input is not trusted. The JSON is checked
// before tinygltf sees it (gltf_json.h), and every accessor range is checked when it is read. Cycles and deep
// hierarchies are refused, and images are never decoded. The field of an Error is a JSON path such as
// "meshes[0].primitives[1].indices".
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "server/base/work_limit.h"
#include "server/scene/asset.h"

namespace sightline {

// Limits for one file. Exceeding one is kResourceExhausted; the message names it.
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
  // Total memory for unpacking buffer views (meshoptimizer) and meshes with their skins (Draco).
  size_t max_unpacked_bytes = size_t{4} << 30;
  // The flags that set the limits, for refusals: of instances, and of the others; empty: none does.
  std::string instances_flag = {}, memory_flag = {};
  // Ends the reading; null: nothing does.
  WorkLimit* work = nullptr;

  // Limits for a server that has so many bytes for geometry: one file takes about as much at most while it is read. A
  // short file can name the same data again and again, so its own size says little.
  static GltfLimits within(size_t bytes);
};

// Returns the bytes of a file to which the document refers by relative URI. The path is percent-decoded, never
// absolute, and without
// "..". Pass nullptr when external files are not allowed, as for uploads: then a reference to one is an Error that
// names it.
using ExternalFile = std::function<Result<std::vector<std::byte>>(const std::string& relative_path)>;

// `bytes` is the whole .glb or .gltf; the first four bytes decide which. Thread-safe. May run for seconds on large
// files.
Result<std::shared_ptr<const SceneAsset>> read_gltf(std::span<const std::byte> bytes, const ExternalFile& external,
                                                    GeometryStore& store, const GltfLimits& limits = {});

// For command-line tools: reads `path`, which may refer to files in its folder and below.
Result<std::shared_ptr<const SceneAsset>> read_gltf_file(const std::string& path, GeometryStore& store,
                                                         const GltfLimits& limits = {});

}  // namespace sightline
