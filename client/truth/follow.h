// The plainest of the baselines (design 9): a camera that follows with a fixed offset and avoids nothing.
#pragma once

#include <span>
#include <vector>

#include "client/truth/judge.h"
#include "client/scenario/scenario_world.h"

namespace sightline {

// Keeps the offset (world axes) from the targets' weighted centre that the scenario's camera has at the
// start, and looks at that centre; no limits, no smoothing.
class FollowCamera {
 public:
  // `world` must be at the scenario's start and have a target.
  explicit FollowCamera(const ScenarioWorld& world);
  // The pose for the scene as `world` has it now.
  Pose pose(const ScenarioWorld& world) const;
  const glm::dvec3& offset_m() const { return offset_m_; }
  const glm::dquat& rotation() const { return rotation_; }

 private:
  glm::dvec3 offset_m_;
  glm::dquat rotation_;
};

// Its path at the times of `frames` and with their lenses. `world` is left at the last time.
std::vector<CameraFrame> follow_path(ScenarioWorld& world, std::span<const CameraFrame> frames);

}  // namespace sightline
