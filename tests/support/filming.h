// Worlds filmed with the default preset. Every step is checked for the limits and for the distance from colliders.
#pragma once

#include <cmath>
#include <utility>

#include "server/settings/step_settings.h"
#include "tests/support/watch.h"

namespace sightline::test {

// The default preset.
struct Filming : World {
  Filming() { settings = preset_settings(Preset::kSightline); }

  // The distance from the lens to the nearest collider, up to 2 m.
  double clearance_m() const {
    ClearanceField field;
    field.gather(mirror, camera().pose.position_m, 3.0, {});
    return field.clearance_m(camera().pose.position_m, 2.0);
  }
  void step_in(Watch& watch, StepResult& result, double dt = 1.0 / 60) {
    result = watch.step(dt);
    EXPECT_GE(clearance_m(), limits.body_radius_m - 1e-6) << "tick " << tick;
  }
};

struct OneFilmed : Filming {
  explicit OneFilmed(const glm::dvec3& camera = {0, 1.6, 6}) {
    add_target(1, {0, 1, 0});
    place(camera, {0, 1, 0});
  }
  double distance_m() const { return glm::distance(camera().pose.position_m, glm::dvec3(0, 1, 0)); }
};

// One target, and shots as a client asks for them.
struct ShotFilmed : OneFilmed {
  using OneFilmed::OneFilmed;
  uint64_t sent = 0;

  void ask(AskedShot asked) {
    shot = std::move(asked);
    shot.number = ++sent;
  }
  // The place of a point in a picture with this field of view, along its edges: right and up, in halves of the picture.
  // Default: the lens without a zoom.
  glm::dvec2 in_halves(const glm::dvec3& point_m, double vertical_fov_rad) const {
    const glm::dvec3 p = inverse_transform_point(camera().pose, point_m);
    return glm::dvec2(p.x / lens.aspect, p.y) / (-p.z * std::tan(vertical_fov_rad / 2));
  }
  glm::dvec2 in_halves(const glm::dvec3& point_m) const { return in_halves(point_m, lens.vertical_fov_rad); }
};

}  // namespace sightline::test
