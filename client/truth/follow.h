// The simplest baseline (design 9): a camera that follows at a fixed offset and avoids nothing.
#pragma once

#include <span>
#include <vector>

#include "client/scenario/scenario_world.h"
#include "client/truth/judge.h"

namespace sightline {

// Keeps the offset (world axes) that the scenario's camera has from the targets' weighted centre at the start, and
// looks at that centre. No limits, no smoothing.
class FollowCamera {
 public:
  // `world` must be at the scenario's start and have at least one target.
  explicit FollowCamera(const ScenarioWorld& world);
  // The pose for the present time of `world`.
  Pose pose(const ScenarioWorld& world) const;
  const glm::dvec3& offset_m() const { return offset_m_; }
  const glm::dquat& rotation() const { return rotation_; }

 private:
  glm::dvec3 offset_m_;
  glm::dquat rotation_;
};

// The follow camera's path at the times of `frames` and with their lenses. Leaves `world` at the last time.
std::vector<CameraFrame> follow_path(ScenarioWorld& world, std::span<const CameraFrame> frames);

}  // namespace sightline
