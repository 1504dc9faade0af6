#include "server/sample/depth_map.h"

#include <algorithm>
#include <cmath>

namespace sightline {
namespace {

// Instances, and the points on them that the camera aims at, lie within 3e9 m. Embree's limit is 1.8e18, in the frame
// of an instance that can be 1e8 times smaller (is_valid_linear).
constexpr double kFarthestEyeM = 4e9;
constexpr double kLongestDirection = 1e9;

// False for NaN.
bool is_within(const glm::dvec3& v, double most) {
  return std::abs(v.x) <= most && std::abs(v.y) <= most && std::abs(v.z) <= most;
}

// The other directions lie between the two.
bool is_castable(const MapRequest& request) {
  const MapView& view = request.view;
  return is_within(view.eye_m, kFarthestEyeM) && is_within(texel_direction(view, 0, 0), kLongestDirection) &&
         is_within(texel_direction(view, view.width - 1, view.height - 1), kLongestDirection) && request.far_m >= 0 &&
         view.near_m >= 0 && std::isfinite(request.ahead_s);
}

}  // namespace

Status check_castable(std::span<const MapRequest> requests) {
  if (std::ranges::all_of(requests, is_castable)) return {};
  return fail(ErrorCode::kInternal, "",
              "a depth map was planned from a place, or in a direction, that is not a finite number");
}

glm::dvec3 texel_direction(const MapView& view, int x, int y) {
  const double u = (x + view.jitter.x) / view.width, v = (y + view.jitter.y) / view.height;
  return view.world_from_view *
         glm::dvec3(view.left + u * (view.right - view.left), view.bottom + v * (view.top - view.bottom), -1.0);
}

double longest_direction(const MapView& view) {
  return std::hypot(1.0, std::max(std::abs(view.left), std::abs(view.right)),
                    std::max(std::abs(view.bottom), std::abs(view.top)));
}

MapPoint project(const MapView& view, const glm::dvec3& point_m) {
  const glm::dvec3 offset = point_m - view.eye_m;
  const glm::dvec3 p = offset * view.world_from_view;  // row vector times matrix: the transpose, view_from_world
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
