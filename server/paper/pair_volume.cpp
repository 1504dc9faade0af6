#include "server/paper/pair_volume.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <numbers>

namespace sightline {
namespace {

// A window on the plane z = 1, around the image of the ball's centre. `axis_rad` is the direction of the centre from
// the z axis, `half_rad` the ball's angular radius. The ball's edges are given by its two tangents in the xz plane,
// because a plane that contains the y direction and touches the ball touches its outline there.
struct Window {
  double middle = 0, half = 0;
};
Window window_around(double axis_rad, double half_rad) {
  const double middle = std::tan(axis_rad);
  double half = 0;
  for (const double edge_rad : {axis_rad - half_rad, axis_rad + half_rad})
    half = std::max(half, std::abs(std::tan(std::clamp(edge_rad, -kWidestRad, kWidestRad)) - middle));
  return {middle, half};
}

double angular_radius(double radius, double distance) {
  return radius < distance ? std::asin(radius / distance) : std::numbers::pi / 2;
}

double lerp(double a, double b, double t) {
  return a + (b - a) * t;
}

MapView view_from(const PairVolume& v, double eye_x, double x_min, double x_max, const glm::dvec2& jitter) {
  MapView view;
  view.eye_m = v.a_m + v.world_from_volume * glm::dvec3(eye_x, 0, 0);
  // Looking along +z of the volume: right = x, up = -y, back = -z is right-handed; row 0 is then at +y.
  view.world_from_view = glm::dmat3(v.world_from_volume[0], -v.world_from_volume[1], -v.world_from_volume[2]);
  view.left = (x_min - eye_x) / v.far_m;
  view.right = (x_max - eye_x) / v.far_m;
  view.bottom = -v.y_top / v.far_m;
  view.top = v.y_top / v.far_m;
  view.width = view.height = v.resolution;
  view.jitter = jitter;
  return view;
}

}  // namespace

PairGap pair_gap(const glm::dvec3& a_m, const glm::dvec3& b_m, const Bound& bound) {
  const glm::dvec3 to_a = a_m - bound.center_m, to_b = b_m - bound.center_m, ab = b_m - a_m;
  const double da = glm::length(to_a), db = glm::length(to_b), length = glm::length(ab);
  if (da <= bound.radius_m || db <= bound.radius_m) return PairGap::kTargetInBound;
  if (length <= kLeastParallax * std::max(da, db)) return PairGap::kTooClose;
  const double from_line = glm::length(glm::cross(to_a, ab)) / length;
  return from_line < kLeastSlantRad * std::max(da, db) ? PairGap::kOnLine : PairGap::kNone;
}

PairVolume make_pair_volume(const glm::dvec3& a_m, const glm::dvec3& b_m, const Bound& bound, int resolution) {
  assert(pair_gap(a_m, b_m, bound) == PairGap::kNone);
  PairVolume v;
  v.a_m = a_m;
  v.length_m = glm::length(b_m - a_m);
  v.resolution = resolution;
  const glm::dvec3 x = (b_m - a_m) / v.length_m, to_center = bound.center_m - a_m;
  const double center_x = glm::dot(to_center, x);
  const glm::dvec3 across = to_center - x * center_x;
  const double center_z = glm::length(across);
  const glm::dvec3 z = across / center_z;
  v.world_from_volume = glm::dmat3(x, glm::cross(z, x), z);
  v.far_m = center_z + bound.radius_m;
  v.y_top = v.far_m * window_around(0.0, angular_radius(bound.radius_m, center_z)).half;
  const auto columns = [&](double x0, double& min, double& max) {
    const double dx = center_x - x0;
    const Window window = window_around(std::atan2(dx, center_z),
                                        angular_radius(bound.radius_m, std::hypot(dx, center_z)));
    min = x0 + v.far_m * (window.middle - window.half), max = x0 + v.far_m * (window.middle + window.half);
  };
  columns(0.0, v.xa_min, v.xa_max);
  columns(v.length_m, v.xb_min, v.xb_max);
  return v;
}

std::array<MapView, 2> pair_views(const PairVolume& v, const glm::dvec2& jitter) {
  return {view_from(v, 0.0, v.xa_min, v.xa_max, jitter), view_from(v, v.length_m, v.xb_min, v.xb_max, jitter)};
}

glm::dvec3 meet(const PairVolume& v, double xa, double xb, double y) {
  const double t = v.length_m / (v.length_m + xa - xb);
  return v.a_m + v.world_from_volume * glm::dvec3(t * xa, t * y, t * v.far_m);
}

PairCoordinates pair_coordinates(const PairVolume& v, const glm::dvec3& point_m) {
  const glm::dvec3 p = (point_m - v.a_m) * v.world_from_volume;
  const double to_far = v.far_m / p.z;
  return {p.x * to_far, v.length_m + (p.x - v.length_m) * to_far, p.y * to_far};
}

double column_of_a(const PairVolume& v, double texel_x) {
  return lerp(v.xa_min, v.xa_max, texel_x / v.resolution);
}
double column_of_b(const PairVolume& v, double texel_x) {
  return lerp(v.xb_min, v.xb_max, texel_x / v.resolution);
}
double row(const PairVolume& v, double texel_y) {
  return lerp(v.y_top, -v.y_top, texel_y / v.resolution);
}

std::optional<glm::ivec3> nearest_texels(const PairVolume& v, const glm::dvec3& point_m, const glm::dvec2& jitter) {
  // A point of the grid at the volume's edge may be outside by rounding.
  constexpr double kSlackTexels = 1e-6;
  const double z = glm::dot(point_m - v.a_m, v.world_from_volume[2]);
  if (z <= 0 || z > v.far_m * (1 + 1e-9)) return std::nullopt;
  const PairCoordinates at = pair_coordinates(v, point_m);
  glm::ivec3 texels;
  const auto take = [&](double x, double min, double max, double at_jitter, int& texel) {
    const double continuous = (x - min) / (max - min) * v.resolution;
    texel = nearest_ray(continuous, at_jitter, v.resolution);
    return continuous >= -kSlackTexels && continuous <= v.resolution + kSlackTexels;
  };
  if (!take(at.xb, v.xb_min, v.xb_max, jitter.x, texels.x) || !take(at.y, v.y_top, -v.y_top, jitter.y, texels.y) ||
      !take(at.xa, v.xa_min, v.xa_max, jitter.x, texels.z))
    return std::nullopt;
  texels.z = v.resolution - 1 - texels.z;
  return texels;
}

size_t count_meetings(const PairVolume& volume, const Bound& bound, const glm::dvec2& jitter) {
  size_t count = 0;
  for_each_meeting(volume, bound, jitter, [&](const glm::ivec3&, const glm::dvec3&) { ++count; });
  return count;
}

}  // namespace sightline
