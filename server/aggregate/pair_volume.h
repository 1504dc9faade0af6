// The pair volume of two targets in closed form (paper 3.2-3.3, design 4.1). It exists only to reproduce the paper.
//
// Both frusta share the far plane z = H and its rows. Rays of equal rows are in one plane through A and B, and meet at
//   t = L / (L + xa - xb),   point = (t xa, t y, t H).
// In the volume's frame, A is the origin and x is along AB. z is the unit part of (centre - A) orthogonal to AB, and y = z cross x.
// L = |AB|. The two rays pass the far plane at (xa, y, H) and (xb, y, H). At each meeting point the
// visibility of both targets is known exactly: no interpolation.
//
// The paper addresses the volume by a trilinear map of its eight corners. Equal pixel steps give a projective grid, which
// agrees with the trilinear one only at the corners, as the tests show.
#pragma once

#include <array>
#include <glm/glm.hpp>
#include <optional>
#include <span>

#include "server/aggregate/candidates.h"
#include "server/bound/bound.h"
#include "server/sample/depth_map.h"

namespace sightline {

// The reason why the rays of two targets do not all meet around the bound. kNone: they do.
enum class PairGap { kNone, kTargetInBound, kOnLine, kTooClose };

// Rays nearer to the line AB would need windows a million times as wide as their depth.
inline constexpr double kLeastSlantRad = 1e-6;

struct PairVolume {
  glm::dvec3 a_m{0.0};
  glm::dmat3 world_from_volume{1.0};  // rotation; columns x, y, z
  double length_m = 0.0;              // L = |AB|
  double far_m = 0.0;                 // H: the common far plane
  double y_top = 0.0;                 // rows run from +y_top (row 0) to -y_top on the far plane
  double xa_min = 0.0, xa_max = 0.0;  // A's window on the far plane, left to right
  double xb_min = 0.0, xb_max = 0.0;  // B's
  int resolution = 0;                 // r: texels a side of both maps
};

// kNone when the volume is complete. Then neither target is in the ball, the ball keeps off the line AB, by kLeastSlantRad as seen from either, and the angle ACB at the
// ball's centre C exceeds the sum of the ball's angular radii seen from A and from B. Otherwise some rays of A meet no ray of B.
PairGap pair_gap(const glm::dvec3& a_m, const glm::dvec3& b_m, const Bound& bound);

// The volume around a bound for which pair_gap is kNone. Its windows enclose the ball.
PairVolume make_pair_volume(const glm::dvec3& a_m, const glm::dvec3& b_m, const Bound& bound, int resolution);

// The two maps to take: A's, then B's.
std::array<MapView, 2> pair_views(const PairVolume& volume, const glm::dvec2& jitter);

// World point where the ray of A through far-plane column xa meets the ray of B through column xb, both in row y (metres
// on the far plane).
glm::dvec3 meet(const PairVolume& volume, double xa, double xb, double y);
// Columns and row on the far plane of a world point in front of both targets.
struct PairCoordinates {
  double xa = 0, xb = 0, y = 0;
};
PairCoordinates pair_coordinates(const PairVolume& volume, const glm::dvec3& point_m);

// Far-plane position of a texel (continuous: texel i's centre is at i + 0.5).
double column_of_a(const PairVolume& volume, double texel_x);
double column_of_b(const PairVolume& volume, double texel_x);
double row(const PairVolume& volume, double texel_y);

// Lists the r^3 meeting points that lie in the bound, each with two bits: 0 for A, 1 for B. Distances are compared at the
// texel itself, with the same rule as look_up.
void compose_pair(const PairVolume& volume, const DepthMap& map_a, const DepthMap& map_b, const Bound& bound,
                  double relative_bias, CandidateSet& candidates);

}  // namespace sightline
