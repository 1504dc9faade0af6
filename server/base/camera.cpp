#include "server/base/camera.h"

#include <cmath>

namespace sightline {

double half_horizontal_fov_rad(const Lens& lens) {
  return std::atan(std::tan(lens.vertical_fov_rad / 2) * lens.aspect);
}

double near_corner_distance_m(const Lens& lens) {
  const double y = std::tan(lens.vertical_fov_rad / 2), x = y * lens.aspect;
  return lens.near_m * std::sqrt(1 + x * x + y * y);
}

}  // namespace sightline
