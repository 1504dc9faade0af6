#include "client/scenario/scenario_session.h"

namespace sightline {
namespace {

void set_target(const ScenarioActor& actor, v1::Target* target) {
  target->set_id(actor.id);
  target->set_weight(actor.weight);
  target->set_required(actor.required);
}

}  // namespace

void set_pose(const Pose& pose, v1::Pose3* message) {
  message->mutable_position()->set_x(pose.position_m.x);
  message->mutable_position()->set_y(pose.position_m.y);
  message->mutable_position()->set_z(pose.position_m.z);
  message->mutable_rotation()->set_x(pose.rotation.x);
  message->mutable_rotation()->set_y(pose.rotation.y);
  message->mutable_rotation()->set_z(pose.rotation.z);
  message->mutable_rotation()->set_w(pose.rotation.w);
}

Pose pose_from(const v1::Pose3& message) {
  const auto& p = message.position();
  const auto& r = message.rotation();
  return {{p.x(), p.y(), p.z()}, glm::dquat(r.w(), r.x(), r.y(), r.z())};
}

v1::OpenSession open_request(const Scenario& scenario, const std::string& scene_hash, uint64_t seed) {
  v1::OpenSession open;
  open.mutable_convention()->set_preset(v1::Convention::PRESET_GLTF);
  open.set_seed(seed);
  open.mutable_scene()->set_hash(scene_hash);
  for (const ScenarioActor& actor : scenario.actors()) {
    v1::NodeBinding* binding = open.mutable_scene()->add_bindings();
    binding->set_node(actor.name);
    binding->set_id(actor.id);
    // Without a change, targets without weight are listed too.
    if (actor.is_target && (actor.during.empty() || actor.is_target_at(0.0))) set_target(actor, open.add_targets());
  }
  set_pose(scenario.camera(), open.mutable_camera());
  open.mutable_lens()->set_field_of_view(scenario.lens().vertical_fov_rad);
  open.mutable_lens()->set_aspect(scenario.lens().aspect);
  open.mutable_lens()->set_near_m(scenario.lens().near_m);
  open.set_label("sightline drive");
  return open;
}

v1::Tick tick_at(const Scenario& scenario, uint64_t sequence, double time_s, double step_s) {
  v1::Tick tick;
  tick.set_sequence(sequence);
  tick.set_time_s(time_s);
  v1::Transforms& transforms = *tick.mutable_transforms();
  const std::vector<ActorMotion> motion = scenario.motion_at(time_s, step_s);
  for (size_t i = 0; i < motion.size(); ++i) {
    transforms.add_ids(scenario.actors()[i].id);
    const auto& [pose, velocity] = motion[i];
    for (const double value : {pose.position_m.x, pose.position_m.y, pose.position_m.z})
      transforms.add_positions(value);
    for (const double value : {pose.rotation.x, pose.rotation.y, pose.rotation.z, pose.rotation.w})
      transforms.add_rotations(static_cast<float>(value));
    for (const double value : {velocity.x, velocity.y, velocity.z})
      transforms.add_velocities(static_cast<float>(value));
  }
  // A little less than a step, so that rounding cannot send a change twice.
  if (scenario.targets_change(time_s - step_s * (1 - 1e-6), time_s))
    for (const ScenarioActor& actor : scenario.actors())
      if (actor.is_target_at(time_s)) set_target(actor, tick.mutable_targets()->add_targets());
  return tick;
}

}  // namespace sightline
