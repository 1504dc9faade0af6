// Framing: which way to look, and how wide, so that all required targets stand in the picture (design 6).
#pragma once

#include <span>

#include "server/base/camera.h"
#include "server/move/choose.h"
#include "server/move/motion.h"
#include "server/settings/framing_settings.h"

namespace sightline {

// Whether there is a zoom range. Without one the lens keeps its field of view.
inline bool zooms(const FramingSettings& settings) {
  return settings.max_vertical_fov_rad > 0.0;
}

struct Aim {
  ViewAngles angles;
  double vertical_fov_rad = 0.0;  // what shows the group with the margin, within the zoom range
  bool fits = true;               // every required target's sphere is inside the picture
};

// Aims from `eye_m`: the weighted mean of the steered targets, moved as little as needed so that all required targets' spheres
// are inside the picture; when they do not fit, the middle of them. `present` decides yaw when the aim is vertical, and
// is returned when the aim lies in the dead zone around it. At least one target must be steered.
Aim aim_at(const glm::dvec3& eye_m, std::span<const TargetView> targets, const ViewAngles& present,
           const Lens& lens, const FramingSettings& settings);

// True when the world point is inside the picture.
bool in_picture(const Pose& world_from_camera, const Lens& lens, const glm::dvec3& point_m);

}  // namespace sightline
