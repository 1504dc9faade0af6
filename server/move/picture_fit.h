// Which share of the targets' bodies does not fit the picture, from many places.
//
// A place between two targets can have a free line of sight to both, and still no picture from there holds both. A
// place right before a target shows a part of it only. What the picture cuts off is lost as if it were hidden.
#pragma once

#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "server/base/camera.h"

namespace sightline {

// A target's body, about a vertical axis.
struct Body {
  glm::dvec3 low_m{0.0}, high_m{0.0};  // the ends of the axis, world metres
  double aside_m = 0.0;                // how far it reaches to the sides; >= 0
  double weight = 1.0;                 // of seeing it (sight_weight.h); 0: it does not count
};

// Reuses memory. Not thread-safe. Deterministic.
class PictureFit {
 public:
  // Sets the places, world metres. The span is not kept.
  void set_places(std::span<const glm::dvec3> position_m);

  // Writes the mean share of the bodies, by weight, that lies outside the picture from each place, [0, 1]; `share` has
  // one entry a place. `lens`: at its widest, if it zooms. The camera is taken to look at the middle of what it would
  // have to show, with this roll (ViewAngles), within +-pi/4. The share of a body is that of the rectangle around it in
  // the picture.
  void outside_share(std::span<const Body> bodies, const Lens& lens, double roll_rad, std::span<float> share);

 private:
  glm::dvec3 origin_m_{0.0};
  // By place.
  std::vector<float> x_m_, y_m_, z_m_;  // from the origin
  // where the camera looks; of unit length in the end
  std::vector<float> forward_x_, forward_y_, forward_z_;
  std::vector<float> right_x_, right_z_;  // level, of unit length
  // tangents of the targets' angles from the middle of the picture
  std::vector<float> least_right_, most_right_, least_up_, most_up_;
};

}  // namespace sightline
