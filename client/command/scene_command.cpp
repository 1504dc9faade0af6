#include "client/command/scene_command.h"

#include <algorithm>
#include <limits>
#include <nlohmann/json.hpp>
#include <numbers>
#include <vector>

#include "client/base/text_table.h"
#include "server/scene/gltf.h"

namespace sightline {
namespace {

constexpr size_t kMaxRows = 50;

size_t placements(const AssetNode& node) {
  return node.mesh < 0 ? 0 : std::max<size_t>(1, node.gpu_instances.size());
}

const Geometry* geometry_of(const SceneAsset& asset, const AssetNode& node) {
  return node.mesh < 0 ? nullptr : asset.meshes[static_cast<size_t>(node.mesh)].get();
}

struct Extents {
  glm::dvec3 min_m{std::numeric_limits<double>::infinity()};
  glm::dvec3 max_m{-std::numeric_limits<double>::infinity()};
};

void grow(Extents& extents, const Geometry& geometry, const Affine& world_from_mesh) {
  for (const glm::vec3& position : geometry.positions) {
    const glm::dvec3 p = transform_point(world_from_mesh, glm::dvec3(position));
    extents.min_m = glm::min(extents.min_m, p);
    extents.max_m = glm::max(extents.max_m, p);
  }
}

// The extents of all triangles in the rest pose.
Extents extents_of(const SceneAsset& asset) {
  Extents extents;
  const std::vector<Affine> world_from_node = rest_world_from_node(asset);
  for (size_t i = 0; i < asset.nodes.size(); ++i) {
    const Geometry* geometry = geometry_of(asset, asset.nodes[i]);
    if (!geometry) continue;
    if (asset.nodes[i].gpu_instances.empty()) grow(extents, *geometry, world_from_node[i]);
    for (const Affine& node_from_instance : asset.nodes[i].gpu_instances)
      grow(extents, *geometry, compose(world_from_node[i], node_from_instance));
  }
  return extents;
}

std::string extents_text(const SceneAsset& asset) {
  const Extents e = extents_of(asset);
  if (e.min_m.x > e.max_m.x) return "none";
  const glm::dvec3 size = e.max_m - e.min_m;
  return formatted("%.2f x %.2f x %.2f m, from (%.2f, %.2f, %.2f) to (%.2f, %.2f, %.2f)", size.x, size.y, size.z,
                   e.min_m.x, e.min_m.y, e.min_m.z, e.max_m.x, e.max_m.y, e.max_m.z);
}

std::string joined(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text.append(text.empty() ? "" : ", ").append(printable(word));
  return text.empty() ? "none" : text;
}

void print_summary(std::ostream& out, const std::string& path, const SceneAsset& asset, const GeometryStore& store) {
  const GeometryBytes bytes = store.live_bytes_by_part();
  size_t stored = 0, meshes = 0;
  for (const auto& mesh : asset.meshes)
    if (mesh) stored += mesh->triangle_count(), ++meshes;
  out << "file        " << path << '\n'
      << "hash        " << to_hex(asset.hash) << '\n'
      << "extents     " << extents_text(asset) << '\n'
      << "triangles   " << grouped(stored) << " stored, " << grouped(asset.triangle_count()) << " as instanced\n"
      << "memory      " << bytes_text(bytes.total()) << " for " << grouped(store.live_count())
      << " different geometries of " << grouped(meshes) << " meshes: positions and indices " << bytes_text(bytes.source)
      << ", clusters " << bytes_text(bytes.clusters) << '\n'
      << "extensions  " << joined(asset.extensions_used) << '\n';
}

// "target, weight 2, optional": what a scenario player reads from the same extras.
std::string role_text(const AssetNode& node) {
  const auto extras = nlohmann::json::parse(node.extras_json, nullptr, false);
  if (!extras.is_object() || !extras.contains("sightline") || !extras["sightline"].is_object()) return "";
  const auto& ours = extras["sightline"];
  if (!ours.contains("role") || !ours["role"].is_string()) return "";
  std::string text = printable(ours["role"].get<std::string>());
  if (ours.contains("weight") && ours["weight"].is_number())
    text += formatted(", weight %g", ours["weight"].get<double>());
  if (ours.contains("required") && ours["required"] == false) text += ", optional";
  return text;
}

// Lists attributes that differ from their defaults.
std::string attributes_text(const InstanceAttributes& attributes) {
  const InstanceAttributes usual;
  std::vector<std::string> words;
  if (attributes.layers != usual.layers) words.push_back(formatted("layers 0x%x", attributes.layers));
  if (attributes.opacity != usual.opacity)
    words.push_back(formatted("opacity %g", static_cast<double>(attributes.opacity)));
  if (!attributes.occludes) words.emplace_back("does not occlude");
  if (!attributes.collides) words.emplace_back("does not collide");
  if (!attributes.visible) words.emplace_back("hidden");
  return words.empty() ? "" : joined(words);
}

int depth_of(const SceneAsset& asset, const AssetNode& node) {
  int depth = 0;
  for (int parent = node.parent; parent >= 0; parent = asset.nodes[static_cast<size_t>(parent)].parent) ++depth;
  return depth;
}

std::string position_text(const Affine& world_from_node) {
  const glm::dvec3 p = world_from_node[3];
  return formatted("%.2f %.2f %.2f", p.x, p.y, p.z);
}

void print_nodes(std::ostream& out, const SceneAsset& asset) {
  out << "\nnodes (" << grouped(asset.nodes.size()) << ")\n";
  Table table({{"name"}, {"position, m"}, {"mesh", true}, {"instances", true}, {"role"}, {"attributes"}});
  const std::vector<Affine> world_from_node = rest_world_from_node(asset);
  size_t left_out = 0;
  for (size_t i = 0; i < asset.nodes.size(); ++i) {
    const AssetNode& node = asset.nodes[i];
    std::string role = role_text(node), attributes = attributes_text(node.attributes);
    if (i >= kMaxRows && role.empty() && attributes.empty()) {
      ++left_out;
      continue;
    }
    table.row({std::string(static_cast<size_t>(2 * depth_of(asset, node)), ' ') + printable(node.name),
               position_text(world_from_node[i]), node.mesh < 0 ? "" : std::to_string(node.mesh),
               node.mesh < 0 ? "" : grouped(placements(node)), std::move(role), std::move(attributes)});
  }
  table.print(out);
  if (left_out > 0) out << "  ... and " << grouped(left_out) << " more\n";
}

void print_meshes(std::ostream& out, const SceneAsset& asset) {
  out << "\nmeshes (" << grouped(asset.meshes.size()) << ")\n";
  std::vector<size_t> uses(asset.meshes.size(), 0);
  for (const AssetNode& node : asset.nodes)
    if (node.mesh >= 0) uses[static_cast<size_t>(node.mesh)] += placements(node);
  Table table(
      {{"", true}, {"name"}, {"triangles", true}, {"see-through", true}, {"instances", true}, {"memory", true}});
  for (size_t i = 0; i < std::min(asset.meshes.size(), kMaxRows); ++i) {
    const Geometry* mesh = asset.meshes[i].get();
    table.row({std::to_string(i), printable(asset.mesh_names[i]), mesh ? grouped(mesh->triangle_count()) : "none",
               mesh ? grouped(mesh->triangle_count() - mesh->occluding_index_count / 3) : "", grouped(uses[i]),
               mesh ? bytes_text(mesh->bytes()) : ""});
  }
  table.print(out);
  if (asset.meshes.size() > kMaxRows) out << "  ... and " << grouped(asset.meshes.size() - kMaxRows) << " more\n";
}

void print_cameras(std::ostream& out, const SceneAsset& asset) {
  if (asset.cameras.empty()) return;
  out << "\ncameras (" << grouped(asset.cameras.size()) << ")\n";
  Table table({{"", true}, {"vertical field of view", true}, {"aspect", true}, {"near", true}});
  for (size_t i = 0; i < std::min(asset.cameras.size(), kMaxRows); ++i) {
    const AssetCamera& camera = asset.cameras[i];
    table.row({std::to_string(i), formatted("%.1f degrees", camera.vertical_fov_rad * 180.0 / std::numbers::pi),
               camera.aspect ? formatted("%.3f", *camera.aspect) : "free", formatted("%.3f m", camera.near_m)});
  }
  table.print(out);
}

void print_animations(std::ostream& out, const SceneAsset& asset) {
  if (asset.animations.empty()) return;
  out << "\nanimations (" << grouped(asset.animations.size()) << ")\n";
  Table table({{"name"}, {"duration", true}, {"channels", true}, {"keys", true}});
  for (size_t i = 0; i < std::min(asset.animations.size(), kMaxRows); ++i) {
    const AssetAnimation& animation = asset.animations[i];
    size_t keys = 0;
    for (const AssetChannel& channel : animation.channels) keys += channel.times_s.size();
    table.row({printable(animation.name), formatted("%.2f s", animation.duration_s), grouped(animation.channels.size()),
               grouped(keys)});
  }
  table.print(out);
}

using Json = nlohmann::ordered_json;

Json json_of(const glm::dvec3& v) {
  return {v.x, v.y, v.z};
}

Json json_of(const Extents& extents) {
  if (extents.min_m.x > extents.max_m.x) return nullptr;
  return {{"min_m", json_of(extents.min_m)}, {"max_m", json_of(extents.max_m)}};
}

Json nodes_json(const SceneAsset& asset) {
  Json nodes = Json::array();
  const std::vector<Affine> world_from_node = rest_world_from_node(asset);
  for (size_t i = 0; i < asset.nodes.size(); ++i) {
    const AssetNode& node = asset.nodes[i];
    nodes.push_back({{"name", node.name},
                     {"parent", node.parent},
                     {"position_m", json_of(glm::dvec3(world_from_node[i][3]))},
                     {"mesh", node.mesh},
                     {"instances", placements(node)},
                     {"role", role_text(node)},
                     {"attributes", attributes_text(node.attributes)}});
  }
  return nodes;
}

Json meshes_json(const SceneAsset& asset) {
  Json meshes = Json::array();
  for (size_t i = 0; i < asset.meshes.size(); ++i) {
    const Geometry* mesh = asset.meshes[i].get();
    const size_t triangles = mesh ? mesh->triangle_count() : 0;
    meshes.push_back({{"name", asset.mesh_names[i]},
                      {"triangles", triangles},
                      {"see_through_triangles", mesh ? triangles - mesh->occluding_index_count / 3 : 0},
                      {"bytes", mesh ? mesh->bytes() : 0}});
  }
  return meshes;
}

// `parent` and `mesh` of a node are indices; -1: none.
Json json_of(const std::string& path, const SceneAsset& asset, const GeometryStore& store) {
  Json cameras = Json::array(), animations = Json::array();
  for (const AssetCamera& camera : asset.cameras)
    cameras.push_back({{"vertical_fov_rad", camera.vertical_fov_rad},
                       {"aspect", camera.aspect ? Json(*camera.aspect) : Json()},
                       {"near_m", camera.near_m}});
  for (const AssetAnimation& animation : asset.animations)
    animations.push_back(
        {{"name", animation.name}, {"duration_s", animation.duration_s}, {"channels", animation.channels.size()}});
  return {{"file", path},
          {"hash", to_hex(asset.hash)},
          {"extents", json_of(extents_of(asset))},
          {"triangles", asset.triangle_count()},
          {"memory_bytes", store.live_bytes_by_part().total()},
          {"geometries", store.live_count()},
          {"extensions", asset.extensions_used},
          {"nodes", nodes_json(asset)},
          {"meshes", meshes_json(asset)},
          {"cameras", std::move(cameras)},
          {"animations", std::move(animations)},
          {"warnings", asset.warnings}};
}

}  // namespace

int run_scene_command(const std::string& path, std::ostream& out, std::ostream& err, bool json) {
  GeometryStore store;
  const auto asset = read_gltf_file(path, store);
  if (!asset) {
    err << path << ": " << to_string(asset.error()) << '\n';
    return 1;
  }
  if (json) {
    // Names come from the file: what is no text is replaced, not refused.
    out << json_of(path, **asset, store).dump(2, ' ', false, Json::error_handler_t::replace) << '\n';
    return 0;
  }
  print_summary(out, path, **asset, store);
  print_nodes(out, **asset);
  print_meshes(out, **asset);
  print_cameras(out, **asset);
  print_animations(out, **asset);
  if (!(*asset)->warnings.empty()) out << "\nwarnings\n";
  for (const std::string& warning : (*asset)->warnings) out << "  " << printable(warning, 200) << '\n';
  return 0;
}

}  // namespace sightline
