// Which share of several targets does not fit the picture, from many places.
//
// A place between two targets can have a free line of sight to both, and still no picture from there holds both. Where the targets have come apart,
// the flight plan treats such a place like one from which a target is hidden. With more than two targets it counts less. Targets that walk
// together are different. A camera that passes near them loses one of them from its picture for a moment only, and the way to better places often
// leads there.
#pragma once

#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "server/base/camera.h"

namespace sightline {

// Returns how far targets have come apart, [0, 1]. It is 0 while the widest gap between two groups of them is at most three times `radius_m`, and 1
// from six times on. `radius_m` > 0 is the mean radius of the targets with a weight. The other parameters are as for PictureFit::outside_share.
// Deterministic.
double apart(std::span<const glm::dvec3> aim_m, std::span<const double> sight_weights, double radius_m);

// Reuses memory. Not thread-safe. Deterministic.
class PictureFit {
 public:
  // Sets the places, world metres. The span is not kept.
  void set_places(std::span<const glm::dvec3> position_m);

  // Writes the share for each place, [0, 1]; `share` has one entry a place. `aim_m`: the points to look at, world metres, at most kMaxTargets. `sight_weights`,
  // parallel, >= 0: 0 for a target that does not count, see sight_weight.h. `lens`: at its widest, if it zooms. The camera is taken to look, without roll, at the middle of what it would have to show. A target whose point is on the picture's edge or inside
  // it fits. From there on the share grows, until at one and a half times the edge's distance from the middle the target counts in full. A
  // camera that cannot show all targets turns to some of them, so the one that weighs most never counts. All are 0 with fewer than two targets.
  void outside_share(std::span<const glm::dvec3> aim_m, std::span<const double> sight_weights, const Lens& lens, std::span<float> share);

 private:
  glm::dvec3 origin_m_{0.0};
  // By place.
  std::vector<float> x_m_, y_m_, z_m_;                                // from the origin
  std::vector<float> forward_x_, forward_y_, forward_z_;              // where the camera looks; of unit length in the end
  std::vector<float> right_x_, right_z_;                              // level, of unit length
  std::vector<float> least_right_, most_right_, least_up_, most_up_;  // tangents of the targets' angles from the middle of the picture
};

}  // namespace sightline
