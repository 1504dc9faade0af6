#include "server/aggregate/pair_volume.h"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace sightline {
namespace {

// The far-plane columns between which a ball is seen from the point `x0` of the line AB. They are given by the ball's two tangents in the
// xz plane, because a plane that contains the y direction and touches the ball touches its outline there.
struct Columns {
  double min, max;
};
Columns columns_around(double center_x, double center_z, double radius, double x0, double far_z) {
  const double dx = center_x - x0;
  const double axis = std::atan2(dx, center_z), half = std::asin(radius / std::hypot(dx, center_z));
  return {x0 + far_z * std::tan(axis - half), x0 + far_z * std::tan(axis + half)};
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
  if (length <= 1e-9) return PairGap::kTooClose;
  const double from_line = glm::length(glm::cross(to_a, ab)) / length;
  if (from_line <= bound.radius_m) return PairGap::kOnLine;
  const auto slant = [&](double distance) { return std::asin(std::min(1.0, from_line / distance)) - std::asin(bound.radius_m / distance); };
  if (std::min(slant(da), slant(db)) < kLeastSlantRad) return PairGap::kOnLine;
  const double between = std::atan2(glm::length(glm::cross(to_a, to_b)), glm::dot(to_a, to_b));
  const double radii = std::asin(bound.radius_m / da) + std::asin(bound.radius_m / db);
  return between > radii ? PairGap::kNone : PairGap::kTooClose;
}

PairVolume make_pair_volume(const glm::dvec3& a_m, const glm::dvec3& b_m, const Bound& bound,
                            int resolution) {
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
  v.y_top = v.far_m * std::tan(std::asin(bound.radius_m / center_z));
  const Columns a = columns_around(center_x, center_z, bound.radius_m, 0.0, v.far_m);
  const Columns b = columns_around(center_x, center_z, bound.radius_m, v.length_m, v.far_m);
  v.xa_min = a.min, v.xa_max = a.max, v.xb_min = b.min, v.xb_max = b.max;
  return v;
}

std::array<MapView, 2> pair_views(const PairVolume& v, const glm::dvec2& jitter) {
  return {view_from(v, 0.0, v.xa_min, v.xa_max, jitter),
          view_from(v, v.length_m, v.xb_min, v.xb_max, jitter)};
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

void compose_pair(const PairVolume& volume, const DepthMap& map_a, const DepthMap& map_b, const Bound& bound,
                  double relative_bias, CandidateSet& candidates) {
  candidates.clear();
  const glm::dvec2 at = map_a.view.jitter;
  const double slack = 1.0 + relative_bias;
  for (int y = 0; y < volume.resolution; ++y) {
    for (int xb = 0; xb < volume.resolution; ++xb) {
      for (int xa = 0; xa < volume.resolution; ++xa) {
        const glm::dvec3 point = meet(volume, column_of_a(volume, xa + at.x), column_of_b(volume, xb + at.x),
                                      row(volume, y + at.y));
        if (!bound.contains(point)) continue;
        const bool sees_a = glm::distance(point, map_a.view.eye_m) <= map_a.distance_at(xa, y) * slack;
        const bool sees_b = glm::distance(point, map_b.view.eye_m) <= map_b.distance_at(xb, y) * slack;
        candidates.add(point, (sees_a ? 1u : 0u) | (sees_b ? 2u : 0u));
      }
    }
  }
}

}  // namespace sightline
