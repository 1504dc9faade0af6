#include "client/scenario/scenario_session.h"

namespace sightline {

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
    if (!actor.is_target) continue;
    v1::Target* target = open.add_targets();
    target->set_id(actor.id);
    target->set_weight(actor.weight);
    target->set_required(actor.required);
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
  return tick;
}

}  // namespace sightline
