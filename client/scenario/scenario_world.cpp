#include "client/scenario/scenario_world.h"

#include <cassert>

namespace sightline {

ScenarioWorld::ScenarioWorld(const Scenario& scenario, EmbreeDevice& device)
    : scenario_(scenario),
      occluders_(device, EmbreeScene::Content::kOccluders),
      colliders_(device, EmbreeScene::Content::kColliders) {}

Result<std::unique_ptr<ScenarioWorld>> ScenarioWorld::make(const Scenario& scenario, GeometryStore& store,
                                                           EmbreeDevice& device) {
  std::vector<NodeBinding> bindings;
  for (const ScenarioActor& actor : scenario.actors()) bindings.push_back({actor.name, actor.id});
  auto instances = instantiate(scenario.asset(), bindings, store);
  if (!instances) return tl::unexpected(instances.error());
  // Actors come first. They are marked as moving now, or the first tick would rebuild the static scene.
  for (size_t i = 0; i < bindings.size(); ++i) (*instances)[i].moving = true;
  std::unique_ptr<ScenarioWorld> world(new ScenarioWorld(scenario, device));
  SceneDelta delta;
  delta.add = std::move(*instances);
  delta.asset_ids_allowed = true;
  if (auto applied = world->mirror_.apply(delta, {}); !applied) return tl::unexpected(applied.error());
  world->set_time(0.0);
  return world;
}

void ScenarioWorld::set_time(double time_s) {
  TransformUpdate update;
  for (const ScenarioActor& actor : scenario_.actors()) update.ids.push_back(actor.id);
  update.poses = scenario_.poses_at(time_s);
  [[maybe_unused]] const Status applied = mirror_.apply({}, update);
  assert(applied);  // the same actors that were added
  occluders_.take_in(mirror_);
  colliders_.take_in(mirror_);
  targets_ = targets_at(scenario_, time_s);
}

glm::dvec3 ScenarioWorld::targets_center_m() const {
  glm::dvec3 sum(0.0);
  double weights = 0.0;
  for (const Target& target : targets_) {
    sum += target.weight * aim_point_m(*mirror_.find(target.instance_id));
    weights += target.weight;
  }
  return sum / weights;
}

bool ScenarioWorld::is_aim_hidden(const Target& target, const glm::dvec3& from_m) const {
  const uint32_t own = *mirror_.slot_of(target.instance_id);
  RayFilter others;
  others.layer_mask = target.layer_mask;
  others.ignored_slots = std::span(&own, 1);
  const glm::dvec3 aim_m = aim_point_m(mirror_.instances()[own]);
  return occluders_.is_blocked(aim_m, glm::vec3(from_m - aim_m), 0.0f, 1.0f, others);
}

std::vector<Target> targets_at(const Scenario& scenario, double time_s) {
  std::vector<Target> targets;
  for (const ScenarioActor& actor : scenario.actors()) {
    if (!actor.is_target_at(time_s)) continue;
    Target& target = targets.emplace_back();
    target.instance_id = actor.id;
    target.weight = actor.weight;
    target.required = actor.required;
  }
  return targets;
}

glm::dvec3 aim_point_m(const Instance& target) {
  return transform_point(target.world_from_instance, glm::dvec3(target.geometry->bounds.center()));
}

}  // namespace sightline
