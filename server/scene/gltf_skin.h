// Skins (glTF 2.0 section 3.7.3.3): the vertices of a mesh where the joints of a skin put them, in the pose of the
// file. The transform of the node that has the mesh does not count for a skinned mesh. But whoever moves that node, or
// a node above it, moves the whole body: so vertices are kept in its frame.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "server/scene/gltf_document.h"

namespace sightline {

struct GltfSkin {
  std::vector<Affine> node_from_vertex;  // by joint; the node is the one that has the mesh
};

// One set of four joints and their weights for each vertex. Weights may be of any scale: their sum counts as 1.
struct GltfInfluences {
  std::vector<float> joints, weights;
};

// Attributes JOINTS_n and WEIGHTS_n with n below this are read.
inline constexpr size_t kMostGltfInfluences = 8;

// The skin of a node of the file. `asset_node_of` and `world_from_node` give the scene's nodes at rest. Empty, with a
// warning, where the skin cannot be used: a joint is not in the scene, or the node is flattened. `field` names the
// node. Fails where the accessor of its matrices is damaged or too short.
Result<std::optional<GltfSkin>> read_gltf_skin(GltfDocument& document, size_t node,
                                               const std::vector<int>& asset_node_of,
                                               const std::vector<Affine>& world_from_node, const std::string& field);

// Set `set` of a primitive of so many vertices, from its accessors; none when it has no such set. `field` names the
// primitive. Fails with kInvalidArgument where weights are missing beside joints, and where they are not as many as the
// vertices.
Result<std::optional<GltfInfluences>> read_gltf_influences(GltfDocument& document, const tinygltf::Primitive& primitive,
                                                           size_t set, size_t vertices, const std::string& field);

// The sets one after the other, so that a hostile file's are never all in memory.
using GltfInfluenceSource = std::function<Result<std::optional<GltfInfluences>>(size_t set)>;

// Moves the vertices of a primitive to where the skin puts them. A vertex without weights belongs to its first joint; a
// primitive without sets stays as it is, with a warning. Fails as `sets` does, and with kInvalidArgument where a joint
// is named that the skin lacks.
Status apply_gltf_skin(GltfDocument& document, const GltfSkin& skin, const GltfInfluenceSource& sets,
                       const std::string& field, std::vector<glm::vec3>& positions);

}  // namespace sightline
