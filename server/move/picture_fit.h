// Which share of several targets does not fit the picture, from many places.
//
// A place can have a free line of sight to two targets and still not show both: between them, the lens would have to be wider than it is. Where
// the targets have come apart, the flight plan treats such a place like one from which a target is hidden (with more than two targets, less so). Targets that walk together are different. A camera that passes
// near them has one of them outside its picture for a moment only, and often the way to better places leads there.
#pragma once

#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "server/base/camera.h"

namespace sightline {

// How far targets have come apart, [0, 1]: 0 while the widest gap between two groups of them is at most three times `radius_m` > 0, the mean
// radius of a target, and 1 from six times on. `aim_m` and `sight_weights` are as below.
double apart(std::span<const glm::dvec3> aim_m, std::span<const double> sight_weights, double radius_m);

// Reuses memory. Not thread-safe. Deterministic.
class PictureFit {
 public:
  // Sets the places, world metres. The span is not kept.
  void set_places(std::span<const glm::dvec3> position_m);

  // Writes the share for each place, [0, 1]. `aim_m`: the points to look at; `sight_weights`, parallel: 0 for a target that does not count, see
  // sight_weight.h. The camera is taken to look, without roll, at the middle of what it would have to show. A target whose point is on the picture's edge or inside
  // it fits. From there on the share grows, until at one and a half times the edge's distance from the middle the target counts in full. A
  // camera that cannot show all targets turns to some of them, so the one that weighs most never counts. All are 0 with fewer than two targets.
  void outside_share(std::span<const glm::dvec3> aim_m, std::span<const double> sight_weights, const Lens& lens, std::span<float> share);

 private:
  glm::dvec3 origin_m_{0.0};
  std::vector<float> x_m_, y_m_, z_m_;                      // of the places, from the origin
  std::vector<float> forward_x_, forward_y_, forward_z_;    // the mean direction; after look_without_roll of unit length
  std::vector<float> right_x_, right_z_;                    // level and of unit length
  std::vector<float> least_right_, most_right_, least_up_, most_up_;  // tangents
};

}  // namespace sightline
