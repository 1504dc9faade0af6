#include "client/check/level.h"

#include "server/scene/gltf.h"
#include "server/wire/suspect_sizes.h"

namespace sightline {
namespace {

// Roles are optional in a level. Where there are some, they have to make a scenario.
void take_roles(Level& level, std::vector<NodeBinding>& bindings) {
  if (!has_roles(*level.asset)) return;
  const auto scenario = Scenario::from_asset(level.asset);
  if (!scenario) {
    level.unplayable = scenario.error();
    return;
  }
  level.actors = scenario->actors();
  level.has_camera = true;
  for (const ScenarioActor& actor : level.actors) bindings.push_back({actor.name, actor.id});
}

// What a session with this level and its targets would be warned of.
std::vector<std::string> warnings_of_session(const Level& level, std::span<const NewInstance> instances) {
  SessionOptions session;
  session.instances.assign(instances.begin(), instances.end());
  session.scene_instances = instances.size();
  for (const ScenarioActor& actor : level.actors)
    if (actor.is_target) session.targets.emplace_back().instance_id = actor.id;
  return suspect_sizes(session);
}

}  // namespace

Result<Level> read_level(const std::string& path) {
  Level level;
  level.store = std::make_unique<GeometryStore>();
  auto asset = read_gltf_file(path, *level.store);
  if (!asset) return tl::unexpected(std::move(asset.error()));
  level.asset = std::move(*asset);
  std::vector<NodeBinding> bindings;
  take_roles(level, bindings);
  auto instances = instantiate(*level.asset, bindings, *level.store);
  if (!instances && !bindings.empty()) {  // such as a target without triangles
    level.unplayable = instances.error();
    level.actors.clear();
    instances = instantiate(*level.asset, {}, *level.store);
  }
  if (!instances) return tl::unexpected(std::move(instances.error()));
  level.session_warnings = warnings_of_session(level, *instances);
  level.mirror = std::make_unique<SceneMirror>();
  SceneDelta delta;
  delta.add = std::move(*instances);
  delta.asset_ids_allowed = true;
  if (const Status applied = level.mirror->apply(delta, {}); !applied) return tl::unexpected(applied.error());
  return level;
}

const std::string& Level::name_of(uint32_t slot) const {
  if (!stands(slot)) return actors[slot].name;
  // The k-th drawable in the order of the file (kAssetIdBit).
  uint64_t left = mirror->instances()[slot].id & ~kAssetIdBit;
  for (const AssetNode& node : asset->nodes) {
    if (node.mesh < 0 || !asset->meshes[static_cast<size_t>(node.mesh)]) continue;
    const size_t placements = std::max<size_t>(1, node.gpu_instances.size());
    if (left < placements) return node.name;
    left -= placements;
  }
  return asset->nodes.back().name;  // not reached
}

}  // namespace sightline
