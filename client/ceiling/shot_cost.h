// What pictures lose against the shot that was asked for, estimated with a few rays.
#pragma once

#include "client/ceiling/sight.h"
#include "server/move/picture_worth.h"

namespace sightline {

class ShotCost {
 public:
  // `sight` must outlive the object. The shot is that of the picture that `asked` takes of the targets as they are in `sight` now.
  ShotCost(const SightEstimate& sight, const glm::dvec3& center_m, const Pose& asked, const Lens& lens);

  // 1 - worth of a picture of the targets as they are in `sight` now, [0, 1]. It is 1 outside the limits of distance and elevation.
  double of(const Pose& world_from_camera, const glm::dvec3& center_m, size_t rays) const;
  // The same of the best picture from a place.
  double from(const glm::dvec3& eye_m, const glm::dvec3& center_m, size_t rays) const;

 private:
  const SightEstimate& sight_;
  const Lens lens_;
  const ShotProperties asked_;
};

}  // namespace sightline
