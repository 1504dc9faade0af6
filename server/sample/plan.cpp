#include "server/sample/plan.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace sightline {
namespace {

// Columns right, up, back for a view along `forward`.
glm::dmat3 frame_along(const glm::dvec3& forward) {
  return glm::mat3_cast(look_rotation(forward, {0, 1, 0}, {1, 0, 0}));
}

// True when the ball reaches into the 90-degree pyramid of a cube face, tested against the four side planes through the
// eye. Conservative near the edges of the pyramid, which costs one map at worst.
bool face_sees_ball(const glm::dmat3& world_from_view, const glm::dvec3& center_from_eye_m, double radius_m) {
  const glm::dvec3 c = center_from_eye_m * world_from_view;
  const double depth = -c.z, reach = radius_m * std::sqrt(2.0);
  return depth - std::abs(c.x) > -reach && depth - std::abs(c.y) > -reach && depth > -radius_m;
}

MapView square_view(const glm::dvec3& eye_m, const glm::dmat3& world_from_view, double half_width, int resolution,
                    const glm::dvec2& jitter) {
  MapView view;
  view.eye_m = eye_m;
  view.world_from_view = world_from_view;
  view.left = view.bottom = -half_width;
  view.right = view.top = half_width;
  view.width = view.height = resolution;
  view.jitter = jitter;
  return view;
}

// Calls take(world_from_view) for each face of a cube.
template <typename Take>
void for_each_face(Take take) {
  for (int axis = 0; axis < 3; ++axis) {
    for (const double sign : {1.0, -1.0}) {
      glm::dvec3 forward(0.0);
      forward[axis] = sign;
      take(frame_along(forward));
    }
  }
}

}  // namespace

int map_resolution(const SampleSettings& settings, const Bound& bound) {
  if (settings.density_per_m3 <= 0) return settings.resolution;
  const double volume_m3 = 4.0 / 3.0 * std::numbers::pi * bound.radius_m * bound.radius_m * bound.radius_m;
  const double wanted = std::ceil(std::cbrt(settings.density_per_m3 * volume_m3));
  return static_cast<int>(
      std::clamp<double>(wanted, kLeastResolution, std::max(settings.resolution, kLeastResolution)));
}

int face_resolution(int resolution) {
  return std::max(kLeastResolution, static_cast<int>(std::lround(resolution / std::tan(kMaxHalfAngleRad))));
}

int plan_views(const glm::dvec3& eye_m, const Bound& bound, const SampleSettings& settings, const glm::dvec2& jitter,
               std::vector<MapView>& views) {
  const glm::dvec3 to_center = bound.center_m - eye_m;
  const double distance = glm::length(to_center);
  if (bound.radius_m < distance * std::sin(kMaxHalfAngleRad)) {
    const double half_width = std::tan(std::asin(bound.radius_m / distance));
    views.push_back(square_view(eye_m, frame_along(to_center), half_width, map_resolution(settings, bound), jitter));
    return 1;
  }
  const size_t before = views.size();
  const int resolution = face_resolution(map_resolution(settings, bound));
  for_each_face([&](const glm::dmat3& world_from_view) {
    if (face_sees_ball(world_from_view, to_center, bound.radius_m))
      views.push_back(square_view(eye_m, world_from_view, 1.0, resolution, jitter));
  });
  return static_cast<int>(views.size() - before);
}

void plan_round(const glm::dvec3& eye_m, int resolution, const glm::dvec2& jitter, std::vector<MapView>& views) {
  for_each_face([&](const glm::dmat3& world_from_view) {
    views.push_back(square_view(eye_m, world_from_view, 1.0, resolution, jitter));
  });
}

MapView plan_sight(const glm::dvec3& eye_m, const glm::dvec3& place_m) {
  // The size of the window does not affect its one centred sample, but a rasteriser must be able to draw it.
  constexpr double kHalfWidth = 1e-3;
  const glm::dvec3 to_place = place_m - eye_m;
  const glm::dvec3 forward = glm::length(to_place) > 1e-9 ? to_place : glm::dvec3(0, 0, -1);
  return square_view(eye_m, frame_along(forward), kHalfWidth, 1, {0.5, 0.5});
}

}  // namespace sightline
