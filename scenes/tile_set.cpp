#include "scenes/tile_set.h"

#include <cstdlib>
#include <filesystem>

#include "server/scene/gltf.h"

namespace sightline::scenes {
namespace {

bool is_door(const AssetNode& node) {
  return node.name.ends_with("_door");
}

// All nodes of a file in one mesh.
MeshData merged(const SceneAsset& asset) {
  const std::vector<Affine> world_from_node = rest_world_from_node(asset);
  MeshData mesh;
  for (size_t n = 0; n < asset.nodes.size(); ++n) {
    if (asset.nodes[n].mesh < 0 || is_door(asset.nodes[n])) continue;
    const Geometry& part = *asset.meshes[static_cast<size_t>(asset.nodes[n].mesh)];
    const auto first = static_cast<uint32_t>(mesh.positions.size());
    for (const glm::vec3& p : part.positions)
      mesh.positions.emplace_back(transform_point(world_from_node[n], glm::dvec3(p)));
    for (const uint32_t index : part.indices) mesh.indices.push_back(first + index);
  }
  return mesh;
}

}  // namespace

std::string tiles_folder(const std::string& folder) {
  if (!folder.empty()) return folder;
  const char* value = std::getenv(kTilesVariable);
  return value ? value : "";
}

Result<PartMeshes> read_tiles(const std::string& folder) {
  if (folder.empty())
    return fail(ErrorCode::kNotFound, "tiles",
                std::string("no folder of tiles was given, neither by --tiles nor by ").append(kTilesVariable));
  PartMeshes meshes;
  GeometryStore store;
  for (size_t k = 0; k < kPartCount; ++k) {
    const std::string path = folder + "/" + std::string(kind_of(static_cast<Part>(k)).tile) + ".glb";
    std::error_code trouble;
    if (!std::filesystem::is_regular_file(path, trouble))
      return fail(ErrorCode::kNotFound, "tiles", path + " is missing");
    const auto asset = read_gltf_file(path, store);
    if (!asset) return tl::unexpected(asset.error());
    meshes[k] = merged(**asset);
  }
  return meshes;
}

}  // namespace sightline::scenes
