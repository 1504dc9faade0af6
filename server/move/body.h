// Body: the camera is a sphere that never touches a collider (design 6). A velocity is taken only when the sphere can move
// along it for the step *and then brake to a stop* in free space, so that at every step there is a safe way on: braking.
#pragma once

#include <array>
#include <glm/glm.hpp>

#include "server/base/camera.h"
#include "server/settings/camera_limits.h"
#include "server/scene/clearance.h"

namespace sightline {

// Kept between the body and every collider, so that rounding and 1 mm sweeps never add up to a touch.
inline constexpr double kBodySkinM = 0.01;

struct SafeMove {
  glm::dvec3 velocity_mps{0.0};
  bool overlap = false;    // the body touches a collider now: a collider moved into it, or it was put there
  bool deflected = false;  // not the velocity that was wanted
};

// The velocity nearest to `wanted_mps` (which already obeys the limits) that is safe: as wanted, slower, along the surface in
// the way, or braking. Where the skin is used up, first away from the nearest surface if nothing stands opposite. When the body overlaps
// a collider, out of it: the velocity that leaves the most room. The result obeys the limits.
// Colliders are taken where the field was gathered; it must cover the camera's reach for braking plus its radius.
SafeMove make_safe(const CameraState& camera, const glm::dvec3& wanted_mps, const CameraLimits& limits,
                   const Lens& lens, const ClearanceField& field, double dt_s);

// When the camera looks for colliders that come towards it, seconds ahead: near enough together that nothing of a person's
// size passes between two looks.
inline constexpr std::array<double, 3> kEvadeS = {0.12, 0.24, 0.4};
using MoversAhead = std::array<ClearanceField, kEvadeS.size()>;  // by kEvadeS, from gather_movers

// `wanted_mps`, changed so that the body is clear of the colliders that move when they and the camera have gone on for each of
// kEvadeS. Obeys the limits. The colliders of now are make_safe's matter, to be called next.
glm::dvec3 evade(const CameraState& camera, const glm::dvec3& wanted_mps, const CameraLimits& limits,
                 const Lens& lens, const MoversAhead& movers, double dt_s);

// Where the body can go straight from one place. The field must outlive it and not change.
class StraightWays {
 public:
  StraightWays(const ClearanceField& field, const glm::dvec3& from_m, double body_radius_m);
  bool is_free(const glm::dvec3& to_m) { return field_.is_free(from_m_, to_m, sweep_m_, blocker_); }

 private:
  const ClearanceField& field_;
  const glm::dvec3 from_m_;
  const double sweep_m_;  // the radius that is swept
  size_t blocker_ = 0;
};

// The radius that is swept: the body's, or the distance to the near plane's corners where that is more.
double swept_radius_m(const CameraLimits& limits, const Lens& lens);

}  // namespace sightline
