// Aims and zooms the camera so that all required targets are in the picture (design 6).
#pragma once

#include <optional>
#include <span>

#include "server/base/camera.h"
#include "server/move/choose.h"
#include "server/move/motion.h"
#include "server/settings/framing_settings.h"

namespace sightline {

// True if there is a zoom range. Without one the lens keeps its field of view.
inline bool zooms(const FramingSettings& settings) {
  return settings.max_vertical_fov_rad > 0.0;
}

// The lens at its widest zoom.
inline Lens widest(Lens lens, const FramingSettings& settings) {
  if (zooms(settings)) lens.vertical_fov_rad = settings.max_vertical_fov_rad;
  return lens;
}

// How the picture is to be composed.
struct AimRules {
  FramingSettings framing = {};
  // by axis, in halves of the picture, [0, 0.9]; empty: FramingSettings::dead_zone for both
  std::optional<glm::dvec2> dead_zone = {};
  // the same, where the camera hurries; 0: nowhere. aim_at does not look at it
  glm::dvec2 soft_zone{0.0};
  double roll_rad = 0.0;  // of the aim, within +-pi/4
  // the yaw that the camera keeps, for views from above; the aim is by the pitch alone
  std::optional<double> fixed_yaw_rad = {};
};

struct Aim {
  ViewAngles angles;
  // how far the present view is from the aim without a dead zone: of yaw and pitch, in halves of the picture; >= 0
  glm::dvec2 off_half_pictures{0.0};
  double vertical_fov_rad = 0.0;  // what shows the group with the margin, within the zoom range
  bool fits = true;               // every required target is inside the picture
};

// The aim from `eye_m`. It brings the steered targets as near as possible to their places in the picture, by weight;
// without any place, their weighted mean to the middle. It is moved as little as needed so that the bodies of all
// required targets are inside the picture, or their spheres where no body is known. When they do not fit, it is at
// their middle. `present` gives the yaw of a vertical aim, and is returned for aims in the dead zone around it, if the
// bodies are inside the picture then. At least one target must be steered.
Aim aim_at(const glm::dvec3& eye_m, std::span<const TrackedTarget> targets, const ViewAngles& present, const Lens& lens,
           const AimRules& rules);

// How far the steered targets are from their places in a picture, by weight: right and up, in halves of the picture.
// Infinite if one that counts is behind the camera.
glm::dvec2 off_place_half_pictures(const Pose& world_from_camera, std::span<const TrackedTarget> targets,
                                   const Lens& lens);

// Returns whether the camera could turn so that the aim points of all targets with a weight are in the picture from
// `eye_m`. If `required_only` is set and some target is required, the required targets suffice. `room` in (0, 1] is the
// share of the picture that they may fill. `present` is as in aim_at.
bool fits_picture(const glm::dvec3& eye_m, std::span<const TrackedTarget> targets, const ViewAngles& present,
                  const Lens& lens, double room, bool required_only);

// Returns whether a world point is inside the picture.
bool in_picture(const Pose& world_from_camera, const Lens& lens, const glm::dvec3& point_m);

}  // namespace sightline
