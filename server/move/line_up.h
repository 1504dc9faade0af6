// Lines a shot up with targets that stand far apart.
//
// A picture from the side and from max_distance_m holds targets only if they stand no farther apart than it is wide
// there. A picture from a place in line with them holds two targets that are nearly twice max_distance_m apart: one
// near, the other far behind it. What must fit are the points to look at. The whole body of the near one fits only from
// some metres behind it. So a shot that cannot hold its targets is turned towards the line through them, only as far as
// necessary. It is turned back when the targets come together. On the way its elevation becomes that of a camera that
// looks at the far one over the near one.
#pragma once

#include <functional>
#include <glm/glm.hpp>
#include <optional>
#include <span>

#include "server/base/camera.h"
#include "server/scene/target.h"
#include "server/settings/move_settings.h"

namespace sightline {

// A shot of targets, at least one of which is steered. Offsets are from their weighted centre to the camera, world
// axes.
struct FarShot {
  std::span<const TrackedTarget> targets;
  glm::dvec3 offset_m{0.0};  // not zero
  glm::dvec3 camera_m{0.0};
  const Lens& lens;
  const MoveSettings& settings;
  glm::dvec3 former_end_m{0.0};  // the offset of the end that was chosen before; zero: none
};

// Returns whether the targets fit the picture from max_distance_m in the direction of the shot. `room` in (0, 1] is the
// share of the picture that they may fill.
bool fits_from_side(const FarShot& shot, double room);

struct LinedUp {
  glm::dvec3 offset_m{0.0};  // as long as that of the shot
  glm::dvec3 end_m{0.0};     // the offset of the end of the line
};

// Returns whether the targets are seen from an offset.
using SeenFrom = std::function<bool(const glm::dvec3& offset_m)>;

// Returns whether they fit from an end of the line, where the camera is max_distance_m from the centre and keeps the
// limits of elevation. All targets are then between min_distance_m and twice max_distance_m away; with less room these
// limits are narrower too.
bool fits_in_line(const FarShot& shot, double room);

// The shot, turned as little as needed towards an end of the line from which they are seen. A turn takes seconds, so it
// begins before the targets fill the picture. Nothing if the shot need not turn, or if there is no such end. The better
// end is tried first. These decide, one after the other: which end was chosen before, which side has more weight of
// required targets, which has more weight, and where the camera is.
std::optional<LinedUp> line_up(const FarShot& shot, const SeenFrom& is_seen_from);

}  // namespace sightline
