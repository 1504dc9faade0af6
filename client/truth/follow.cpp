#include "client/truth/follow.h"

namespace sightline {

FollowCamera::FollowCamera(const ScenarioWorld& world) {
  const Pose& start = world.scenario().camera();
  offset_m_ = start.position_m - world.targets_center_m();
  rotation_ = look_rotation(-offset_m_, {0, 1, 0}, start.rotation * glm::dvec3(1, 0, 0));
}

Pose FollowCamera::pose(const ScenarioWorld& world) const {
  return {world.targets_center_m() + offset_m_, rotation_};
}

std::vector<CameraFrame> follow_path(ScenarioWorld& world, std::span<const CameraFrame> frames) {
  world.set_time(0.0);
  const FollowCamera follow(world);
  std::vector<CameraFrame> path(frames.begin(), frames.end());
  for (CameraFrame& frame : path) {
    world.set_time(frame.time_s);
    frame.camera = follow.pose(world);
    frame.jump = false;
  }
  return path;
}

}  // namespace sightline
