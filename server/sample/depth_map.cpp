#include "server/sample/depth_map.h"

#include <algorithm>
#include <cmath>

namespace sightline {

glm::dvec3 texel_direction(const MapView& view, int x, int y) {
  const double u = (x + view.jitter.x) / view.width, v = (y + view.jitter.y) / view.height;
  return view.world_from_view * glm::dvec3(view.left + u * (view.right - view.left),
                                           view.bottom + v * (view.top - view.bottom), -1.0);
}

double longest_direction(const MapView& view) {
  return std::hypot(1.0, std::max(std::abs(view.left), std::abs(view.right)), std::max(std::abs(view.bottom), std::abs(view.top)));
}

MapPoint project(const MapView& view, const glm::dvec3& point_m) {
  const glm::dvec3 offset = point_m - view.eye_m;
  const glm::dvec3 p =
      offset * view.world_from_view;  // row vector times matrix: the transpose, view_from_world
  MapPoint out;
  out.depth_m = -p.z;
  if (p.z >= 0.0) return out;
  out.x = (p.x / -p.z - view.left) / (view.right - view.left) * view.width;
  out.y = (p.y / -p.z - view.bottom) / (view.top - view.bottom) * view.height;
  out.in_window = out.x >= 0 && out.x < view.width && out.y >= 0 && out.y < view.height;
  return out;
}

int nearest_ray(double coordinate, double jitter, int count) {
  return static_cast<int>(std::clamp(std::floor(coordinate - jitter + 0.5), 0.0, static_cast<double>(count - 1)));
}

}  // namespace sightline
