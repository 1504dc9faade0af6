// Worlds filmed with the default preset. Every step is checked for the limits and for the distance from colliders.
#pragma once

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

}  // namespace sightline::test
