// A glTF document between parsing and conversion, and the parts of the conversion. Private to the reader.
#pragma once

#include <tiny_gltf.h>

#include <cstddef>
#include <deque>
#include <map>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "server/scene/gltf.h"

namespace sightline {

// Warnings about a file that can be read nevertheless. Bounded, so that a hostile file cannot fill the log.
class GltfWarnings {
 public:
  void add(std::string text);
  std::vector<std::string> take() { return std::move(texts_); }

 private:
  static constexpr size_t kMax = 100;
  std::vector<std::string> texts_;
};

// The remaining part of each limit while a document is converted.
struct GltfBudget {
  size_t triangles = 0;
  size_t vertices = 0;  // of accessors read, used or not: bounds the work as well as the memory
  size_t instances = 0;
  size_t animation_values = 0;
  size_t unpacked_bytes = 0;
  std::string instances_flag = {};  // as GltfLimits

  // Takes `amount` from `left`, or says which limit (`what`) `field` would exceed.
  static Status take(size_t& left, size_t amount, const std::string& field, const char* what);
  Status take_instances(size_t amount, const std::string& field);
};

// Every reference inside `json` and `model` is valid (gltf_check.cpp); the ranges of accessors are checked when they
// are read.
struct GltfDocument {
  const nlohmann::json& json;  // the whole document
  WorkLimit::Part& work;       // of the thread that reads it
  tinygltf::Model model = {};  // of the checked members only
  // One per buffer, exactly byteLength long. A buffer whose bytes could not be had is empty.
  std::vector<std::span<const std::byte>> buffers = {};
  // Why, by buffer. It is no error until something reads from it: exporters leave placeholders behind.
  std::map<size_t, Error> absent_buffers = {};
  // by buffer view: those that were packed and have been read
  std::map<size_t, std::span<const std::byte>> unpacked_views = {};
  std::deque<std::vector<std::byte>> owned = {};  // bytes of buffers and views that are not in the file itself
  std::vector<ContentHash> external_hashes = {};  // of each file read, in order
  GltfBudget budget = {};
  GltfWarnings warnings = {};
};

inline Result<std::span<const std::byte>> gltf_buffer_bytes(const GltfDocument& document, size_t buffer) {
  if (const auto absent = document.absent_buffers.find(buffer); absent != document.absent_buffers.end())
    return tl::unexpected(absent->second);
  return document.buffers[buffer];
}

// Fails when the work on the document has to end. Between parts that are long.
inline Status go_on(GltfDocument& document) {
  if (document.work.ends_now()) return tl::unexpected(document.work.limit()->error());
  return {};
}

// "nodes[3]", "meshes[0].primitives[1]"
std::string gltf_path(const char* collection, size_t index);

// gltf_mesh.cpp: every mesh as one geometry, and once more for each node that has it with a skin (gltf_skin.h). Those
// nodes then name the mesh of their own. The nodes must have been read.
Status read_gltf_meshes(GltfDocument& document, GeometryStore& store, const std::vector<int>& asset_node_of,
                        SceneAsset& asset);

// gltf_nodes.cpp: cameras and the hierarchy of the default scene. `asset_node_of` gives the index in
// asset.nodes of a node of the file, -1 for one outside the scene.
Status read_gltf_nodes(GltfDocument& document, const GltfLimits& limits, SceneAsset& asset,
                       std::vector<int>& asset_node_of);

// gltf_animation.cpp
Status read_gltf_animations(GltfDocument& document, const std::vector<int>& asset_node_of, SceneAsset& asset);

}  // namespace sightline
