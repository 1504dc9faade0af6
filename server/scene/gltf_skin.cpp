#include "server/scene/gltf_skin.h"

#include <algorithm>
#include <cmath>

#include "server/scene/gltf_accessor.h"

namespace sightline {
namespace {

constexpr size_t kJointsInSet = 4;

Affine affine_of(const float* columns) {
  Affine a;
  for (int column = 0; column < 4; ++column)
    for (int row = 0; row < 3; ++row) a[column][row] = static_cast<double>(columns[4 * column + row]);
  return a;
}

bool is_invertible(const Affine& a) {
  const double volume = std::abs(glm::determinant(glm::dmat3(a[0], a[1], a[2])));
  return volume > 0.0 && std::isfinite(1.0 / volume);
}

}  // namespace

Result<std::optional<GltfSkin>> read_gltf_skin(GltfDocument& document, size_t node,
                                               const std::vector<int>& asset_node_of,
                                               const std::vector<Affine>& world_from_node, const std::string& field) {
  const auto index = static_cast<size_t>(document.model.nodes[node].skin);
  const nlohmann::json& source = document.json["skins"][index];
  const auto joints = source["joints"].get<std::vector<size_t>>();
  const Affine& world_from_mesh = world_from_node[static_cast<size_t>(asset_node_of[node])];
  const auto unused = [&](const char* why) {
    document.warnings.add(field + ".skin: " + why + ", so the mesh is drawn without its skin");
    return std::optional<GltfSkin>();
  };
  if (!is_invertible(world_from_mesh)) return unused("the node is flattened");
  const Affine mesh_from_world = inverse(world_from_mesh);
  std::vector<float> binds;
  if (source.contains("inverseBindMatrices")) {
    const std::string binds_field = gltf_path("skins", index) + ".inverseBindMatrices";
    auto read = read_gltf_floats(document, source["inverseBindMatrices"].get<int>(), 16, GltfComponents::kFloatOnly,
                                 binds_field);
    if (!read) return tl::unexpected(std::move(read.error()));
    if (read->size() < 16 * joints.size()) return invalid(binds_field, "must be as many as the joints");
    binds = std::move(*read);
  }
  GltfSkin skin;
  for (size_t k = 0; k < joints.size(); ++k) {
    const int joint = asset_node_of[joints[k]];
    if (joint < 0) return unused("one of its joints is not in the scene");
    const Affine joint_from_vertex = binds.empty() ? identity_affine() : affine_of(&binds[16 * k]);
    skin.node_from_vertex.push_back(
        compose(mesh_from_world, compose(world_from_node[static_cast<size_t>(joint)], joint_from_vertex)));
  }
  return skin;
}

Result<std::optional<GltfInfluences>> read_gltf_influences(GltfDocument& document, const tinygltf::Primitive& primitive,
                                                           size_t set, size_t vertices, const std::string& field) {
  const std::string number = std::to_string(set), joints_key = "JOINTS_" + number, weights_key = "WEIGHTS_" + number;
  const auto joints = primitive.attributes.find(joints_key), weights = primitive.attributes.find(weights_key);
  if (joints == primitive.attributes.end()) return std::nullopt;
  const std::string joints_field = field + ".attributes." + joints_key,
                    weights_field = field + ".attributes." + weights_key;
  if (weights == primitive.attributes.end()) return invalid(weights_field, "is required beside " + joints_key);
  auto which = read_gltf_floats(document, joints->second, kJointsInSet, GltfComponents::kFloatOrAnyInteger,
                                joints_field);
  if (!which) return tl::unexpected(std::move(which.error()));
  auto shares = read_gltf_floats(document, weights->second, kJointsInSet, GltfComponents::kFloatOrNormalized,
                                 weights_field);
  if (!shares) return tl::unexpected(std::move(shares.error()));
  if (which->size() != kJointsInSet * vertices) return invalid(joints_field, "must be as many as the positions");
  if (shares->size() != kJointsInSet * vertices) return invalid(weights_field, "must be as many as the positions");
  return GltfInfluences{std::move(*which), std::move(*shares)};
}

Status apply_gltf_skin(GltfDocument& document, const GltfSkin& skin, const GltfInfluenceSource& sets,
                       const std::string& field, std::vector<glm::vec3>& positions) {
  std::vector<glm::dvec3> sums(positions.size(), glm::dvec3(0.0));
  std::vector<double> weights(positions.size(), 0.0);
  std::vector<size_t> first(positions.size(), 0);
  for (size_t set = 0; set < kMostGltfInfluences; ++set) {
    const auto influences = sets(set);
    if (!influences) return tl::unexpected(influences.error());
    if (!*influences && set > 0) break;
    if (!*influences) {
      document.warnings.add(field + ": has no JOINTS_0, and is drawn without its skin");
      return {};
    }
    for (size_t i = 0; i < positions.size(); ++i)
      for (size_t k = 0; k < kJointsInSet; ++k) {
        const double weight = static_cast<double>((*influences)->weights[kJointsInSet * i + k]);
        const float joint = (*influences)->joints[kJointsInSet * i + k];
        if (weight == 0.0 && (set > 0 || k > 0)) continue;
        if (!(joint >= 0.0f && joint < static_cast<float>(skin.node_from_vertex.size())))
          return invalid(gltf_path((field + ".attributes.JOINTS_" + std::to_string(set)).c_str(), i),
                         "names a joint that the skin lacks");
        if (set == 0 && k == 0) first[i] = static_cast<size_t>(joint);
        sums[i] += weight *
                   transform_point(skin.node_from_vertex[static_cast<size_t>(joint)], glm::dvec3(positions[i]));
        weights[i] += weight;
      }
  }
  for (size_t i = 0; i < positions.size(); ++i)
    positions[i] = weights[i] > 0 ? sums[i] / weights[i]
                                  : transform_point(skin.node_from_vertex[first[i]], glm::dvec3(positions[i]));
  return {};
}

}  // namespace sightline
