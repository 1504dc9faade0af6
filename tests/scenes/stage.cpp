#include "tests/scenes/stage.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <stdexcept>

namespace sightline {
namespace {

template <typename T>
T value_of(Result<T> result) {
  if (!result) throw std::runtime_error(to_string(result.error()));
  return std::move(*result);
}

void check(const Status& status) {
  if (!status) throw std::runtime_error(to_string(status.error()));
}

std::vector<Role> roles_in(const SceneAsset& asset) {
  std::vector<Role> roles;
  for (size_t n = 0; n < asset.nodes.size(); ++n) {
    const AssetNode& node = asset.nodes[n];
    if (node.extras_json.empty()) continue;
    const auto ours = nlohmann::json::parse(node.extras_json).at("sightline");
    if (!ours.contains("role")) continue;
    const std::string role = ours.at("role");
    roles.push_back({static_cast<int>(n), node.name, role, role == "camera" ? 0 : n + 1});
  }
  return roles;
}

Pose pose_from(const Affine& world_from_node) {
  const glm::dmat3 rotation(world_from_node[0], world_from_node[1], world_from_node[2]);
  return {world_from_node[3], glm::normalize(glm::quat_cast(rotation))};
}

}  // namespace

Stage::Stage(std::span<const std::byte> bytes)
    : asset_(value_of(read_gltf(bytes, nullptr, store_))), roles_(roles_in(*asset_)) {
  std::vector<NodeBinding> bindings;
  for (const Role& role : roles_)
    if (role.id != 0) bindings.push_back({role.name, role.id});
  SceneDelta delta;
  delta.add = value_of(instantiate(*asset_, bindings, store_));
  delta.asset_ids_allowed = true;
  check(mirror_.apply(delta, {}));
}

std::vector<Role> Stage::with_role(const std::string& role) const {
  std::vector<Role> matching;
  std::copy_if(roles_.begin(), roles_.end(), std::back_inserter(matching),
               [&](const Role& r) { return r.role == role; });
  return matching;
}

Pose Stage::pose_of(const Role& role, double time_s) const {
  return pose_from(animated_world_from_node(*asset_, animation(), time_s)[static_cast<size_t>(role.node)]);
}

void Stage::play(double time_s) {
  const std::vector<Affine> world_from_node = animated_world_from_node(*asset_, animation(), time_s);
  TransformUpdate update;
  for (const Role& role : roles_) {
    if (role.id == 0) continue;
    update.ids.push_back(role.id);
    update.poses.push_back(pose_from(world_from_node[static_cast<size_t>(role.node)]));
  }
  check(mirror_.apply({}, update));
}

std::vector<uint32_t> Stage::target_slots() const {
  std::vector<uint32_t> slots;
  for (const Role& role : with_role("target")) slots.push_back(mirror_.slot_of(role.id).value());
  std::sort(slots.begin(), slots.end());
  return slots;
}

}  // namespace sightline
