// Lines a shot up with targets that stand far apart.
//
// From the side, the picture from max_distance_m holds targets only if they stand no farther apart than it is wide there. From a place in line
// with them it holds two targets that are nearly twice max_distance_m apart: one near, the other far behind it. So a shot that cannot
// hold its targets is turned towards the line through them, and lowered on the way, since the near one would leave the picture of a camera
// that looks down. It is turned only as far as necessary, and back again when the targets come together.
#pragma once

#include <glm/glm.hpp>
#include <optional>
#include <span>

#include "server/base/camera.h"
#include "server/scene/target.h"
#include "server/settings/move_settings.h"

namespace sightline {

// A shot of targets, at least one of which is steered. Offsets are from their weighted centre to the camera, world axes.
struct FarShot {
  std::span<const TrackedTarget> targets;
  glm::dvec3 offset_m{0.0};  // not zero
  glm::dvec3 camera_m{0.0};
  const Lens& lens;
  const MoveSettings& settings;
};

// Returns whether the targets fit the picture from max_distance_m in the direction of the shot. `room` in (0, 1] is the share of the picture that
// they may fill.
bool fits_from_side(const FarShot& shot, double room);

// The offset of a place at an end of the line from which they fit, or nothing. It is max_distance_m long and keeps the limits of elevation. All targets
// are between min_distance_m and twice max_distance_m away. The end with the greater weight of required targets is tried first, then that with
// the greater weight of all, then that on the side of the camera.
std::optional<glm::dvec3> in_line_offset_m(const FarShot& shot, double room);

// The offset of the shot, turned as little as needed. A turn takes seconds, so it begins before the targets fill the picture. If they do not fit
// in line either, the offset is the shot's own. The length is that of the shot's offset.
glm::dvec3 line_up(const FarShot& shot);

}  // namespace sightline
