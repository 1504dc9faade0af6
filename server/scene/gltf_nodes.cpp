// Cameras and the node hierarchy (glTF 2.0 sections 3.5 and 3.10, EXT_mesh_gpu_instancing).
#include <algorithm>
#include <cmath>
#include <optional>

#include "server/scene/gltf_accessor.h"
#include "server/scene/gltf_document.h"

namespace sightline {
namespace {

constexpr double kMatrixRounding = 1e-5;      // of products in single precision
constexpr double kMaxWorldCoordinate = 1e12;  // of any axis or origin in the world, metres

// A rotation whose length is not 1 is normalised; false when it has no direction at all.
bool normalize(glm::dquat& rotation) {
  const double length = glm::length(rotation);
  if (!(length > 1e-6) || !std::isfinite(length)) return false;
  rotation /= length;
  return true;
}

// Rotation times per-axis scale; false when `a` shears or an axis vanishes.
bool decompose(const Affine& a, AssetNode& node) {
  glm::dvec3 scale(glm::length(a[0]), glm::length(a[1]), glm::length(a[2]));
  if (!(scale.x > 0.0 && scale.y > 0.0 && scale.z > 0.0)) return false;
  glm::dmat3 axes(a[0] / scale.x, a[1] / scale.y, a[2] / scale.z);
  constexpr double kShear = 1e-4;  // cosine between axes; exporters write single precision
  if (std::abs(glm::dot(axes[0], axes[1])) > kShear || std::abs(glm::dot(axes[1], axes[2])) > kShear ||
      std::abs(glm::dot(axes[2], axes[0])) > kShear)
    return false;
  if (glm::determinant(axes) < 0.0) scale.x = -scale.x, axes[0] = -axes[0];
  node.translation_m = a[3];
  node.rotation = glm::normalize(glm::quat_cast(axes));
  node.scale = scale;
  return true;
}

Status read_matrix(const std::vector<double>& m, const std::string& field, GltfWarnings& warnings, AssetNode& node) {
  const double departure = std::max({std::abs(m[3]), std::abs(m[7]), std::abs(m[11]), std::abs(m[15] - 1.0)});
  if (!(departure <= kMatrixRounding)) return invalid(field + ".matrix", "must have the last row 0 0 0 1");
  if (departure > 0.0) warnings.add(field + ".matrix: its last row is 0 0 0 1 but for rounding, and is taken as that");
  node.parent_from_node = Affine(m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10], m[12], m[13], m[14]);
  if (!decompose(node.parent_from_node, node)) {
    node.decomposed = false;
    warnings.add(field + ".matrix: shears or flattens, so the node cannot be animated");
  }
  return {};
}

Status read_local_transform(const tinygltf::Node& source, const std::string& field, GltfWarnings& warnings,
                            AssetNode& node) {
  if (!source.matrix.empty()) return read_matrix(source.matrix, field, warnings, node);
  const auto& t = source.translation;
  const auto& r = source.rotation;
  const auto& s = source.scale;
  if (!t.empty()) node.translation_m = {t[0], t[1], t[2]};
  if (!r.empty()) node.rotation = glm::dquat(r[3], r[0], r[1], r[2]);
  if (!s.empty()) node.scale = {s[0], s[1], s[2]};
  if (!normalize(node.rotation)) return invalid(field + ".rotation", "must be a unit quaternion");
  node.parent_from_node = make_affine(node.translation_m, node.rotation, node.scale);
  return {};
}

// One attribute of EXT_mesh_gpu_instancing; empty when absent.
struct InstanceAttribute {
  const char* name;
  int components;
  GltfComponents allowed;
  std::vector<float> values;
};

Status read_gpu_instances(GltfDocument& document, const tinygltf::Value& extension, const std::string& field,
                          std::vector<Affine>& instances) {
  const tinygltf::Value& attributes = extension.Get("attributes");
  InstanceAttribute translation{"TRANSLATION", 3, GltfComponents::kFloatOnly, {}};
  InstanceAttribute rotation{"ROTATION", 4, GltfComponents::kFloatOrNormalized, {}};
  InstanceAttribute scale{"SCALE", 3, GltfComponents::kFloatOnly, {}};
  std::optional<size_t> count;
  for (InstanceAttribute* attribute : {&translation, &rotation, &scale}) {
    if (!attributes.Has(attribute->name)) continue;
    const int accessor = attributes.Get(attribute->name).GetNumberAsInt();
    const size_t elements = document.model.accessors[static_cast<size_t>(accessor)].count;
    const std::string attribute_field = field + ".attributes." + attribute->name;
    if (count.value_or(elements) != elements) return invalid(attribute_field, "must be as long as the others");
    if (!count)
      if (const Status s = document.budget.take_instances(elements, field); !s) return s;
    count = elements;
    auto values = read_gltf_floats(document, accessor, attribute->components, attribute->allowed, attribute_field);
    if (!values) return tl::unexpected(std::move(values.error()));
    attribute->values = std::move(*values);
  }
  for (size_t i = 0; i < count.value_or(0); ++i) {
    const auto vec3_at = [i](const std::vector<float>& v, double otherwise) {
      return v.empty() ? glm::dvec3(otherwise) : glm::dvec3(v[3 * i], v[3 * i + 1], v[3 * i + 2]);
    };
    glm::dquat r(1.0, 0.0, 0.0, 0.0);
    if (const auto& v = rotation.values; !v.empty()) r = glm::dquat(v[4 * i + 3], v[4 * i], v[4 * i + 1], v[4 * i + 2]);
    if (!normalize(r))
      return invalid(gltf_path((field + ".attributes.ROTATION").c_str(), i), "must be a unit quaternion");
    instances.push_back(make_affine(vec3_at(translation.values, 0.0), r, vec3_at(scale.values, 1.0)));
  }
  return {};
}

Status read_instances(GltfDocument& document, const tinygltf::Node& source, const std::string& field, AssetNode& node) {
  if (source.mesh < 0) return {};
  if (const auto it = source.extensions.find("EXT_mesh_gpu_instancing"); it != source.extensions.end())
    return read_gpu_instances(document, it->second, field + ".extensions.EXT_mesh_gpu_instancing", node.gpu_instances);
  return document.budget.take_instances(1, field);
}

// gltf_check.cpp has checked the members.
void read_extras(const nlohmann::json& extras, AssetNode& node) {
  node.extras_json = extras.dump();
  if (!extras.contains("sightline")) return;
  const nlohmann::json& ours = extras["sightline"];
  InstanceAttributes& to = node.attributes;
  to.layers = ours.value("layers", to.layers);
  to.opacity = ours.value("opacity", to.opacity);
  const auto read_flag = [&](const char* key, bool& flag) {
    if (ours.contains(key)) flag = ours[key].is_boolean() ? ours[key].get<bool>() : ours[key] == 1;
  };
  read_flag("occludes", to.occludes);
  read_flag("collides", to.collides);
  read_flag("visible", to.visible);
}

// KHR_node_visibility: the node and all below it are hidden.
bool is_hidden(const nlohmann::json& node) {
  const auto extensions = node.find("extensions");
  if (extensions == node.end()) return false;
  const auto visibility = extensions->find("KHR_node_visibility");
  return visibility != extensions->end() && !visibility->value("visible", true);
}

Result<AssetNode> read_node(GltfDocument& document, size_t index, const std::vector<int>& asset_camera_of) {
  const tinygltf::Node& source = document.model.nodes[index];
  const std::string field = gltf_path("nodes", index);
  AssetNode node;
  node.name = source.name;
  node.mesh = source.mesh;
  node.camera = source.camera < 0 ? -1 : asset_camera_of[static_cast<size_t>(source.camera)];
  const nlohmann::json& json = document.json["nodes"][index];
  if (json.contains("extras")) read_extras(json["extras"], node);
  if (const Status s = read_local_transform(source, field, document.warnings, node); !s)
    return tl::unexpected(s.error());
  if (const Status s = read_instances(document, source, field, node); !s) return tl::unexpected(s.error());
  return node;
}

// The parent of every node, -1 for roots. A node with two parents is refused.
Result<std::vector<int>> find_parents(const tinygltf::Model& model) {
  std::vector<int> parent(model.nodes.size(), -1);
  for (size_t i = 0; i < model.nodes.size(); ++i)
    for (const int child : model.nodes[i].children) {
      int& known = parent[static_cast<size_t>(child)];
      if (known >= 0)
        return invalid(gltf_path("nodes", i) + ".children", "node " + std::to_string(child) + " has two parents");
      known = static_cast<int>(i);
    }
  return parent;
}

// As each node has at most one parent, the walk visits each node at most once. A node that no root reaches is on or
// below a cycle. The depth is bounded, because later code may recurse over the hierarchy of a hostile file.
Status check_hierarchy(const tinygltf::Model& model, const std::vector<int>& parent, int max_depth) {
  std::vector<int> depth(parent.size(), 0);
  std::vector<size_t> open;
  for (size_t i = 0; i < parent.size(); ++i)
    if (parent[i] < 0) depth[i] = 1, open.push_back(i);
  while (!open.empty()) {
    const size_t node = open.back();
    open.pop_back();
    if (depth[node] > max_depth)
      return fail(ErrorCode::kResourceExhausted, gltf_path("nodes", node),
                  "stands deeper than " + std::to_string(max_depth) + " levels");
    for (const int child : model.nodes[node].children) {
      depth[static_cast<size_t>(child)] = depth[node] + 1;
      open.push_back(static_cast<size_t>(child));
    }
  }
  for (size_t i = 0; i < depth.size(); ++i)
    if (depth[i] == 0) return invalid(gltf_path("nodes", i), "is part of a cycle");
  return {};
}

// The default scene, else the first one, else every root.
Result<std::vector<int>> find_roots(const tinygltf::Model& model, const std::vector<int>& parent) {
  std::vector<int> roots;
  if (model.scenes.empty()) {
    for (size_t i = 0; i < parent.size(); ++i)
      if (parent[i] < 0) roots.push_back(static_cast<int>(i));
    return roots;
  }
  const size_t scene = model.defaultScene < 0 ? 0 : static_cast<size_t>(model.defaultScene);
  std::vector<bool> listed(parent.size(), false);
  for (const int node : model.scenes[scene].nodes) {
    const auto index = static_cast<size_t>(node);
    if (parent[index] >= 0 || listed[index])
      return invalid(gltf_path("scenes", scene) + ".nodes",
                     "node " + std::to_string(node) + " must be a root, listed once");
    listed[index] = true;
    roots.push_back(node);
  }
  return roots;
}

std::vector<int> read_cameras(GltfDocument& document, SceneAsset& asset) {
  std::vector<int> asset_camera_of;
  for (size_t i = 0; i < document.model.cameras.size(); ++i) {
    const tinygltf::Camera& camera = document.model.cameras[i];
    if (camera.type != "perspective") {
      document.warnings.add(gltf_path("cameras", i) + ": orthographic cameras are skipped");
      asset_camera_of.push_back(-1);
      continue;
    }
    asset_camera_of.push_back(static_cast<int>(asset.cameras.size()));
    AssetCamera& out = asset.cameras.emplace_back();
    out.vertical_fov_rad = camera.perspective.yfov;
    if (camera.perspective.aspectRatio > 0.0) out.aspect = camera.perspective.aspectRatio;
    out.near_m = camera.perspective.znear;
  }
  return asset_camera_of;
}

bool within_reach(const Affine& a) {
  for (int column = 0; column < 4; ++column)
    for (int row = 0; row < 3; ++row)
      if (!(std::abs(a[column][row]) <= kMaxWorldCoordinate)) return false;
  return true;
}

Status check_world(const SceneAsset& asset, const std::vector<int>& asset_node_of) {
  const std::vector<Affine> world_from_node = rest_world_from_node(asset);
  for (size_t i = 0; i < asset_node_of.size(); ++i) {
    if (asset_node_of[i] < 0) continue;
    const auto node = static_cast<size_t>(asset_node_of[i]);
    bool sound = within_reach(world_from_node[node]);
    for (const Affine& instance : asset.nodes[node].gpu_instances)
      sound = sound && within_reach(compose(world_from_node[node], instance));
    if (!sound) return invalid(gltf_path("nodes", i), "its transform in the world is not finite or beyond 1e12 m");
  }
  return {};
}

}  // namespace

Status read_gltf_nodes(GltfDocument& document, const GltfLimits& limits, SceneAsset& asset,
                       std::vector<int>& asset_node_of) {
  const tinygltf::Model& model = document.model;
  const auto parent = find_parents(model);
  if (!parent) return tl::unexpected(parent.error());
  if (const Status s = check_hierarchy(model, *parent, limits.max_node_depth); !s) return s;
  const auto roots = find_roots(model, *parent);
  if (!roots) return tl::unexpected(roots.error());
  const std::vector<int> asset_camera_of = read_cameras(document, asset);

  asset_node_of.assign(model.nodes.size(), -1);
  std::vector<bool> hidden;  // by asset node: by KHR_node_visibility, its own or that of a node above
  std::vector<int> open(roots->rbegin(), roots->rend());
  while (!open.empty()) {
    const auto index = static_cast<size_t>(open.back());
    open.pop_back();
    if (document.work.ends(4)) return tl::unexpected(document.work.limit()->error());
    auto node = read_node(document, index, asset_camera_of);
    if (!node) return tl::unexpected(std::move(node.error()));
    if ((*parent)[index] >= 0) node->parent = asset_node_of[static_cast<size_t>((*parent)[index])];
    hidden.push_back(is_hidden(document.json["nodes"][index]) ||
                     (node->parent >= 0 && hidden[static_cast<size_t>(node->parent)]));
    if (hidden.back()) node->attributes.visible = false;
    asset_node_of[index] = static_cast<int>(asset.nodes.size());
    asset.nodes.push_back(std::move(*node));
    const auto& children = model.nodes[index].children;
    open.insert(open.end(), children.rbegin(), children.rend());
  }
  return check_world(asset, asset_node_of);
}

}  // namespace sightline
