#include "server/step/carried_state.h"

namespace sightline {

void place_camera(CarriedState& state, const Pose& pose, const glm::dvec3& velocity_mps) {
  state.camera.pose = pose;
  state.camera.velocity_mps = velocity_mps;
  state.camera.acceleration_mps2 = glm::dvec3(0.0);
  state.camera.angular_velocity_radps = glm::dvec3(0.0);
  state.turn = TurnState{};
  state.turn.angles = angles_from_rotation(pose.rotation);
  state.shot.is_set = false;
  state.horizon_s = 0.0;
  state.goal_m.reset();
  state.shares.forget();
  state.given_up.clear();
  state.not_aimed_at.clear();
  state.viewpoints.forget();
}

void observe_camera(CarriedState& state, const Pose& pose, const glm::dvec3& velocity_mps) {
  const bool wants_shot = state.shot.is_set;
  const double horizon_s = state.horizon_s;
  place_camera(state, pose, velocity_mps);
  state.shot.is_set = wants_shot;
  state.horizon_s = horizon_s;
}

}  // namespace sightline
