#include <algorithm>
#include <cmath>
#include <unordered_map>
#include <unordered_set>

#include "server/scene/mirror.h"

namespace sightline {
namespace {

constexpr int kUnbound = -1;

Affine rigid(const Pose& pose) {
  return make_affine(pose.position_m, pose.rotation, {1, 1, 1});
}

glm::dmat3 linear_of(const Affine& a) {
  return glm::dmat3(a[0], a[1], a[2]);
}

double greatest_difference(const Affine& a, const Affine& b) {
  double greatest = 0.0;
  for (int column = 0; column < 4; ++column)
    for (int row = 0; row < 3; ++row) greatest = std::max(greatest, std::abs(a[column][row] - b[column][row]));
  return greatest;
}

// Less than the resolution of a float at 100 m.
bool is_identity(const Affine& a) {
  return greatest_difference(a, identity_affine()) < 1e-9;
}

// A rotation near to a linear map: keeps its x axis and makes the y axis perpendicular to it (Gram-Schmidt).
glm::dquat rotation_of(const Affine& a) {
  if (!is_valid_linear(linear_of(a))) return {1, 0, 0, 0};
  const glm::dvec3 x = glm::normalize(a[0]);
  const glm::dvec3 y = glm::normalize(a[1] - x * glm::dot(x, a[1]));
  return glm::normalize(glm::quat_cast(glm::dmat3(x, y, glm::cross(x, y))));
}

// A node with a sheared matrix has no rotation; all others keep the rotation in the file.
glm::dquat local_rotation(const AssetNode& node) {
  const Affine trs = make_affine(node.translation_m, node.rotation, node.scale);
  const double size = 1.0 + max_stretch(node.parent_from_node);
  return greatest_difference(trs, node.parent_from_node) < 1e-6 * size ? node.rotation
                                                                       : rotation_of(node.parent_from_node);
}

std::vector<Pose> rest_poses(const SceneAsset& asset, const std::vector<Affine>& world_from_node) {
  std::vector<Pose> poses(asset.nodes.size());
  for (size_t i = 0; i < poses.size(); ++i) {
    const int parent = asset.nodes[i].parent;
    const glm::dquat above = parent < 0 ? glm::dquat(1, 0, 0, 0) : poses[static_cast<size_t>(parent)].rotation;
    poses[i] = {world_from_node[i][3], glm::normalize(above * local_rotation(asset.nodes[i]))};
  }
  return poses;
}

// One drawable object of the file.
struct Drawable {
  size_t node;
  Affine world_from_mesh;
  Pose pose;
  const std::shared_ptr<const Geometry>& geometry;
};

// Calls visit(Drawable) for every drawable, in file order.
template <typename Visit>
void for_each_drawable(const SceneAsset& asset, const std::vector<Affine>& world_from_node,
                       const std::vector<Pose>& poses, Visit visit) {
  for (size_t i = 0; i < asset.nodes.size(); ++i) {
    const AssetNode& node = asset.nodes[i];
    if (node.mesh < 0 || !asset.meshes[static_cast<size_t>(node.mesh)]) continue;
    const auto& geometry = asset.meshes[static_cast<size_t>(node.mesh)];
    if (node.gpu_instances.empty()) visit(Drawable{i, world_from_node[i], poses[i], geometry});
    for (const Affine& node_from_instance : node.gpu_instances) {
      const Affine world = compose(world_from_node[i], node_from_instance);
      visit(Drawable{
          i, world, {world[3], glm::normalize(poses[i].rotation * rotation_of(node_from_instance))}, geometry});
    }
  }
}

// Merges meshes in one frame.
class Merged {
 public:
  void append(const Geometry& geometry, const Affine& to_frame, bool occludes) {
    const auto first = static_cast<uint32_t>(positions_.size());
    for (const glm::vec3& p : geometry.positions) positions_.emplace_back(transform_point(to_frame, p));
    const bool mirrored = glm::determinant(linear_of(to_frame)) < 0;
    for (size_t i = 0; i < geometry.indices.size(); i += 3) {
      const uint32_t *t = &geometry.indices[i], a = first + t[0], b = first + t[1], c = first + t[2];
      auto& list = occludes && i < geometry.occluding_index_count ? occluding_ : see_through_;
      list.insert(list.end(), {a, mirrored ? c : b, mirrored ? b : c});
    }
    only_ = parts_++ == 0 && occludes && is_identity(to_frame) ? &geometry : nullptr;
  }

  size_t position_count() const { return positions_.size(); }
  // Set when the result would be this one mesh, unchanged.
  const Geometry* only() const { return only_; }

  MeshData take() {
    MeshData mesh{std::move(positions_), std::move(occluding_), UINT32_MAX};
    mesh.see_through_first_index = static_cast<uint32_t>(mesh.indices.size());
    mesh.indices.insert(mesh.indices.end(), see_through_.begin(), see_through_.end());
    return mesh;
  }

 private:
  std::vector<glm::vec3> positions_;
  std::vector<uint32_t> occluding_, see_through_;
  const Geometry* only_ = nullptr;
  size_t parts_ = 0;
};

class Instantiation {
 public:
  Instantiation(const SceneAsset& asset, std::span<const NodeBinding> bindings, GeometryStore& store)
      : asset_(asset),
        bindings_(bindings),
        store_(store),
        world_from_node_(rest_world_from_node(asset)),
        poses_(rest_poses(asset, world_from_node_)) {}

  Result<std::vector<NewInstance>> run() {
    if (Status ok = bind(); !ok) return tl::unexpected(ok.error());
    spread_down();
    if (Status ok = merge_bound(); !ok) return tl::unexpected(ok.error());
    if (Status ok = add_remaining(); !ok) return tl::unexpected(ok.error());
    return std::move(instances_);
  }

 private:
  // Step 1: which node each binding names.
  Status bind() {
    std::unordered_map<std::string_view, std::vector<int>> by_name;
    for (size_t i = 0; i < asset_.nodes.size(); ++i) by_name[asset_.nodes[i].name].push_back(static_cast<int>(i));
    std::unordered_set<uint64_t> ids;
    binding_of_.assign(asset_.nodes.size(), kUnbound);
    for (size_t b = 0; b < bindings_.size(); ++b) {
      const auto& [name, id] = bindings_[b];
      if (id == 0 || (id & kAssetIdBit) != 0) return invalid(field(b, "id"), "must be from 1 to 2^63 - 1");
      if (!ids.insert(id).second) return invalid(field(b, "id"), "used twice");
      const auto found = by_name.find(name);
      if (found == by_name.end())
        return fail(ErrorCode::kNotFound, field(b, "node"), "the scene has no node named \"" + name + "\"");
      if (found->second.size() > 1)
        return invalid(field(b, "node"), "the scene has more than one node named \"" + name + "\"");
      const int node = found->second.front();
      if (binding_of_[node] != kUnbound) return invalid(field(b, "node"), "\"" + name + "\" is bound twice");
      binding_of_[node] = static_cast<int>(b);
      bound_node_.push_back(static_cast<size_t>(node));
    }
    return {};
  }

  // Step 2: nodes below a bound one belong to it, up to the next bound one. Parents come before children.
  void spread_down() {
    for (size_t i = 0; i < binding_of_.size(); ++i)
      if (binding_of_[i] == kUnbound && asset_.nodes[i].parent >= 0)
        binding_of_[i] = binding_of_[static_cast<size_t>(asset_.nodes[i].parent)];
  }

  // Step 3: one instance a binding.
  Status merge_bound() {
    std::vector<Merged> merged(bindings_.size());
    std::vector<std::shared_ptr<const Geometry>> single(bindings_.size());
    Status ok;
    for_each_drawable(asset_, world_from_node_, poses_, [&](const Drawable& drawable) {
      const int b = binding_of_[drawable.node];
      if (b == kUnbound || !ok) return;
      const size_t top = bound_node_[static_cast<size_t>(b)];
      const InstanceAttributes& own = asset_.nodes[drawable.node].attributes;
      if (drawable.node != top && !own.visible) return;
      const bool occludes = drawable.node == top || (own.occludes && own.opacity >= kOccludingOpacity);
      Merged& into = merged[static_cast<size_t>(b)];
      if (into.position_count() + drawable.geometry->positions.size() > UINT32_MAX) {
        ok = fail(ErrorCode::kResourceExhausted, field(static_cast<size_t>(b), "node"), "too many vertices");
        return;
      }
      into.append(*drawable.geometry, compose(inverse(rigid(poses_[top])), drawable.world_from_mesh), occludes);
      single[static_cast<size_t>(b)] = drawable.geometry;
    });
    for (size_t b = 0; b < bindings_.size() && ok; ++b) ok = add_bound(b, merged[b], single[b]);
    return ok;
  }

  Status add_bound(size_t b, Merged& merged, const std::shared_ptr<const Geometry>& single) {
    auto geometry = merged.only() ? Result<std::shared_ptr<const Geometry>>(single) : store_.intern(merged.take());
    if (!geometry) return bad_transform(bound_node_[b]);
    if ((*geometry)->triangle_count() == 0)
      return invalid(field(b, "node"), "\"" + bindings_[b].node_name + "\" has no triangles below it");
    NewInstance instance;
    instance.id = bindings_[b].id;
    instance.geometry = *geometry;
    instance.pose = poses_[bound_node_[b]];
    instance.attributes = asset_.nodes[bound_node_[b]].attributes;
    return push(std::move(instance), bound_node_[b]);
  }

  // Step 4: everything else, each with an asset id.
  Status add_remaining() {
    uint64_t k = 0;
    Status ok;
    for_each_drawable(asset_, world_from_node_, poses_, [&](const Drawable& drawable) {
      const uint64_t id = kAssetIdBit | k++;
      if (ok && binding_of_[drawable.node] == kUnbound) ok = add_drawable(drawable, id);
    });
    return ok;
  }

  Status add_drawable(const Drawable& drawable, uint64_t id) {
    NewInstance instance;
    instance.id = id;
    instance.pose = drawable.pose;
    instance.attributes = asset_.nodes[drawable.node].attributes;
    instance.geometry = drawable.geometry;
    const Affine rest = compose(inverse(rigid(drawable.pose)), drawable.world_from_mesh);
    if (is_valid_linear(linear_of(rest))) {
      if (!is_identity(rest)) instance.linear = linear_of(rest);
      return push(std::move(instance), drawable.node);
    }
    Merged flat;
    flat.append(*drawable.geometry, rest, true);
    auto geometry = store_.intern(flat.take());
    if (!geometry) return bad_transform(drawable.node);
    if ((*geometry)->triangle_count() == 0) return {};
    instance.geometry = *geometry;
    return push(std::move(instance), drawable.node);
  }

  Status push(NewInstance instance, size_t node) {
    const glm::dvec3 p = glm::abs(instance.pose.position_m);
    const bool in_reach = p.x <= kMaxCoordinateM && p.y <= kMaxCoordinateM && p.z <= kMaxCoordinateM;
    if (!in_reach || !is_finite(instance.pose.rotation)) return bad_transform(node);
    instances_.push_back(std::move(instance));
    return {};
  }

  Status bad_transform(size_t node) const {
    return invalid("asset",
                   "node \"" + asset_.nodes[node].name + "\": its position or size is not finite or beyond 1e9 m");
  }

  static std::string field(size_t binding, const char* member) {
    return indexed("bindings", binding).append(".").append(member);
  }

  const SceneAsset& asset_;
  const std::span<const NodeBinding> bindings_;
  GeometryStore& store_;
  const std::vector<Affine> world_from_node_;
  const std::vector<Pose> poses_;
  std::vector<int> binding_of_;     // by node: the binding that it belongs to
  std::vector<size_t> bound_node_;  // by binding
  std::vector<NewInstance> instances_;
};

}  // namespace

Result<std::vector<NewInstance>> instantiate(const SceneAsset& asset, std::span<const NodeBinding> bindings,
                                             GeometryStore& store) {
  return Instantiation(asset, bindings, store).run();
}

}  // namespace sightline
