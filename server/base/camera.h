// The camera as every stage sees it: its pose and motion, its lens and its limits.
#pragma once

#include <glm/glm.hpp>

#include "server/base/transform.h"

namespace sightline {

// A camera with zero size is a lens at `pose.position_m`, looking along its own -Z.
struct CameraState {
  Pose pose;                               // world_from_camera
  glm::dvec3 velocity_mps{0.0};            // world frame
  glm::dvec3 acceleration_mps2{0.0};       // of the last step: its change of the velocity, by its time; world frame
  glm::dvec3 angular_velocity_radps{0.0};  // world frame
};

// Fields of view lie between these.
inline constexpr double kMinFovRad = 0.01, kMaxFovRad = 3.0;

struct Lens {
  double vertical_fov_rad = 0.6981317007977318;  // full angle, (kMinFovRad, kMaxFovRad); default 40 degrees
  double aspect = 16.0 / 9.0;                    // width / height, [0.1, 10]
  double near_m = 0.1;                           // [1e-6, 10]
};

// Half of the horizontal field of view, radians.
double half_horizontal_fov_rad(const Lens& lens);
// Distance from the lens to a corner of the near rectangle, metres: a body at least this large contains it.
double near_corner_distance_m(const Lens& lens);

}  // namespace sightline
