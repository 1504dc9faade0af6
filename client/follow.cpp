#include "client/follow.h"

namespace sightline {

std::vector<CameraFrame> follow_path(ScenarioWorld& world, std::span<const CameraFrame> frames) {
  world.set_time(0.0);
  const Pose& start = world.scenario().camera();
  const glm::dvec3 offset_m = start.position_m - world.targets_center_m();
  const glm::dvec3 right = start.rotation * glm::dvec3(1, 0, 0);
  std::vector<CameraFrame> path(frames.begin(), frames.end());
  for (CameraFrame& frame : path) {
    world.set_time(frame.time_s);
    const glm::dvec3 center_m = world.targets_center_m();
    frame.camera = {center_m + offset_m, look_rotation(-offset_m, {0, 1, 0}, right)};
    frame.jump = false;
  }
  return path;
}

}  // namespace sightline
