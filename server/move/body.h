// The camera body: a sphere that never touches a collider (design 6). A velocity is taken only if the sphere can move
// along it for the step and then brake to a stop in free space. So braking is a safe way on at every step.
#pragma once

#include <array>
#include <glm/glm.hpp>
#include <optional>

#include "server/base/camera.h"
#include "server/scene/clearance.h"
#include "server/settings/camera_limits.h"

namespace sightline {

// Kept between the body and every collider, so that rounding and 1 mm sweeps never add up to a touch.
inline constexpr double kBodySkinM = 0.01;

struct SafeMove {
  glm::dvec3 velocity_mps{0.0};
  // the body touches a collider or is inside one now: a collider moved into it, or it was put there
  bool overlap = false;
};

// A safe velocity near `wanted_mps`, which must obey the limits already: as wanted, slower, along the surface in the
// way, or braking. A body closer than kBodySkinM to a surface first moves away from it, unless another surface is
// opposite. A body that overlaps a collider takes the velocity that leaves it the most room. If its centre is inside a
// solid, or surfaces are opposite, it goes to the nearest free place instead (way_out). The result obeys the limits.
// Colliders are where `field` gathered them. The field must cover the braking distance plus the body radius.
// A body deep inside a solid touches no surface. It is found, and leaves the solid, only if `blind`: the camera sees no
// target. A camera that sees one is not walled in.
SafeMove make_safe(const CameraState& camera, const glm::dvec3& wanted_mps, const CameraLimits& limits,
                   const Lens& lens, const ClearanceField& field, double dt_s, bool blind = false);

// The place nearest to `from_m`, within 10 m and the gathered ball, where the body is free with its skin and outside of
// every solid. From inside a solid the straight way leads through its surface; from elsewhere it passes no surface. The
// ways that are tried leave across the surfaces around, so the result is exact beside flat ones. Empty when there is
// none. Costs about 1 ms; for a camera that is in a collider only.
std::optional<glm::dvec3> way_out(const ClearanceField& field, const glm::dvec3& from_m, double body_radius_m);

// The times, in seconds ahead, at which the camera checks for colliders that come towards it. They are so close that
// nothing of a person's size passes between two checks. The last is the time in which a camera with the default limits
// stops from 4.5 m/s, the speed of a plan: v / a + a / j. A camera that looks less far ahead comes to a closing door
// too fast to stop, and too late to pass.
inline constexpr std::array<double, 4> kEvadeS = {0.12, 0.24, 0.4, 0.55};
using MoversAhead = std::array<ClearanceField, kEvadeS.size()>;  // by kEvadeS, from gather_movers

// Changes `wanted_mps` so that the body is clear of moving colliders at each of kEvadeS. Where there is no room away
// from them, such as in a doorway whose door shuts, the camera goes to the side with the most room. The result obeys
// the limits. Call make_safe next; it takes care of the colliders as they are now, which `field` has gathered as for
// make_safe.
glm::dvec3 evade(const CameraState& camera, const glm::dvec3& wanted_mps, const CameraLimits& limits, const Lens& lens,
                 const MoversAhead& movers, const ClearanceField& field, double dt_s);

// Tests whether the body can go straight from one position to others. The field must outlive the object and not change.
class StraightWays {
 public:
  StraightWays(const ClearanceField& field, const glm::dvec3& from_m, double body_radius_m);
  bool is_free(const glm::dvec3& to_m) { return field_.is_free(from_m_, to_m, sweep_m_, blocker_); }

 private:
  const ClearanceField& field_;
  const glm::dvec3 from_m_;
  const double sweep_m_;  // the radius that is swept
  size_t blocker_ = ClearanceField::kNoBlocker;
};

// The radius that is swept: the body radius or the distance to the near plane's corners, whichever is larger.
double swept_radius_m(const CameraLimits& limits, const Lens& lens);

}  // namespace sightline
