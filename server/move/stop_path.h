// The path on which a camera comes to rest. A limit of the jerk bends and lengthens it: the present acceleration has to fade before the
// camera brakes with all that it may.
#pragma once

#include <array>
#include <glm/glm.hpp>
#include <span>

#include "server/base/camera.h"
#include "server/settings/camera_limits.h"

namespace sightline {

// The corners of a polyline that the path follows to within a few millimetres, the camera's position first. A path without a limit of the
// jerk is one straight piece. Path lengths hold for steps of any duration: shorter steps brake later than longer ones.
class StopPath {
 public:
  static constexpr size_t kMostCorners = 12;

  StopPath(const CameraState& camera, const CameraLimits& limits);

  std::span<const glm::dvec3> corners_m() const { return {corners_m_.data(), count_}; }
  const glm::dvec3& end_m() const { return corners_m_[count_ - 1]; }
  // The path turns. A step so long that the jerk limits nothing would then brake on another path, straight ahead.
  bool bends() const { return bends_; }

 private:
  void add(const glm::dvec3& corner_m);
  void follow(const CameraState& camera, const CameraLimits& limits);

  std::array<glm::dvec3, kMostCorners> corners_m_;
  size_t count_ = 0;
  bool bends_ = false;
};

}  // namespace sightline
