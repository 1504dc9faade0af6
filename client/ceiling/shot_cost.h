// Estimates with a few rays how much a picture loses against the shot that was asked for.
#pragma once

#include "client/ceiling/sight.h"
#include "server/move/picture_worth.h"

namespace sightline {

class ShotCost {
 public:
  // `sight` must outlive the object. The asked shot is the one that a camera at `asked` (world) has of the targets as
  // they are in `sight` now. `center_m`: the targets' weighted centre, world.
  ShotCost(const SightEstimate& sight, const glm::dvec3& center_m, const Pose& asked, const Lens& lens);

  // 1 - worth of a picture (server/move/picture_worth.h) of the targets as they are in `sight` now, [0, 1]. It is 1
  // outside the limits of distance and elevation.
  double of(const Pose& world_from_camera, const glm::dvec3& center_m, size_t rays) const;
  // The same of the best picture from a place.
  double from(const glm::dvec3& eye_m, const glm::dvec3& center_m, size_t rays) const;

 private:
  const SightEstimate& sight_;
  const Lens lens_;
  const ShotProperties asked_;
};

}  // namespace sightline
