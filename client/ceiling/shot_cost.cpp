#include "client/ceiling/shot_cost.h"

#include "client/truth/coherence.h"

namespace sightline {

ShotCost::ShotCost(const SightEstimate& sight, const glm::dvec3& center_m, const Pose& asked, const Lens& lens)
    : sight_(sight), lens_(lens), asked_(shot_properties({.time_s = 0.0, .camera = asked, .lens = lens}, center_m)) {}

double ShotCost::of(const Pose& world_from_camera, const glm::dvec3& center_m, size_t rays) const {
  if (!sight_.is_allowed(world_from_camera.position_m)) return 1.0;
  const ShotProperties now = shot_properties({.time_s = 0.0, .camera = world_from_camera, .lens = lens_}, center_m);
  const double departs = shot_loss(deviation_between(asked_, now), ShotWeights{});
  // Rays are traced only where the picture can still be worth something.
  return departs >= 1.0 ? 1.0 : 1.0 - picture_worth(sight_.whole_loss(world_from_camera, rays), departs);
}

double ShotCost::from(const glm::dvec3& eye_m, const glm::dvec3& center_m, size_t rays) const {
  return of({eye_m, rotation_from_angles(best_aim(eye_m, sight_.targets(), {}, lens_))}, center_m, rays);
}

}  // namespace sightline
