// The pair volume of two targets (paper 3.2-3.3, Figure 1), in closed form: the intersection of their two frusta.
// Wherever a ray of A meets a ray of B inside the bound there is a candidate.
//
// Both frusta share the far plane z = H and its rows. Rays of equal rows are in one plane through A and B, and meet at
//   t = L / (L + xa - xb),   point = (t xa, t y, t H).
// In the volume's frame, A is the origin and x is along AB. z is the unit part of (centre - A) orthogonal to AB, and y
// = z cross x. L = |AB|. The two rays pass the far plane at (xa, y, H) and (xb, y, H). At each meeting point the
// visibility of both targets is known exactly: no interpolation.
//
// Local coordinates are (u, v, w): a column of B, a row, and a column of A counted from the right, as in the paper. The
// paper maps them to the world by a trilinear map of the volume's eight corners. Equal pixel steps give a projective
// grid, which agrees with the trilinear one only at the corners, as the tests show.
//
// Both windows are centred on the image of the bound's centre and enclose the bound, as far as its edges are within
// kWidestRad of the z axis. So for an odd number of columns, not jittered, the middle rays meet at the centre itself.
// Often not all rays meet: those of targets near each other diverge. Then the volume covers a part of the bound, with
// fewer than r^3 candidates.
#pragma once

#include <array>
#include <glm/glm.hpp>
#include <optional>

#include "server/bound/bound.h"
#include "server/sample/depth_map.h"

namespace sightline {

// The reason why two targets have no pair volume. kTargetInBound: one of them is in the bound. kOnLine: the bound's
// centre is on the line AB, or so near that from one of the targets it is seen less than kLeastSlantRad beside it.
// kTooClose: the targets are at one point, or no two rays of the resolution meet inside the bound. kNone: they have
// one.
enum class PairGap { kNone, kTargetInBound, kOnLine, kTooClose };

// Rays nearer to the line AB would need windows a million times as wide as their depth.
inline constexpr double kLeastSlantRad = 1e-6;
// Targets whose distance is a smaller share of that to the bound are at one point: rounding decides where their rays
// meet.
inline constexpr double kLeastParallax = 1e-6;
// An edge of the bound that is farther than this from the z axis counts as this far. A window reaches as far to either
// side of its middle, so its outer edge may be farther out.
inline constexpr double kWidestRad = 1.3089969389957472;  // 75 degrees

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

// What can be told without the resolution: kTooClose for targets at one point only.
PairGap pair_gap(const glm::dvec3& a_m, const glm::dvec3& b_m, const Bound& bound);

// The volume around a bound for which pair_gap is kNone. `resolution`: texels a side of both maps, [1, kMaxMapSize].
PairVolume make_pair_volume(const glm::dvec3& a_m, const glm::dvec3& b_m, const Bound& bound, int resolution);

// The two maps to take: A's, then B's.
std::array<MapView, 2> pair_views(const PairVolume& volume, const glm::dvec2& jitter);

// World point where the ray of A through far-plane column xa meets the ray of B through column xb, both in row y
// (metres on the far plane). The rays meet if L + xa - xb > 0.
glm::dvec3 meet(const PairVolume& volume, double xa, double xb, double y);
// Columns and row on the far plane of a world point in front of both targets: the inverse of `meet`.
struct PairCoordinates {
  double xa = 0, xb = 0, y = 0;
};
PairCoordinates pair_coordinates(const PairVolume& volume, const glm::dvec3& point_m);

// The texels (u, v, w) whose rays pass nearest to a world point; empty if the point is outside the volume: behind the
// far plane, or outside a window. A point of the grid keeps its own texels.
std::optional<glm::ivec3> nearest_texels(const PairVolume& volume, const glm::dvec3& point_m, const glm::dvec2& jitter);

// Far-plane position of a texel (continuous: texel i's centre is at i + 0.5).
double column_of_a(const PairVolume& volume, double texel_x);
double column_of_b(const PairVolume& volume, double texel_x);
double row(const PairVolume& volume, double texel_y);

// Calls take(texels, point) for each two rays that meet in the bound: their texels (u, v, w), each in [0, r), and the
// world point. O(r^3).
template <typename Take>
void for_each_meeting(const PairVolume& volume, const Bound& bound, const glm::dvec2& jitter, Take take) {
  const int r = volume.resolution;
  for (int y = 0; y < r; ++y) {
    for (int xb = 0; xb < r; ++xb) {
      for (int xa = 0; xa < r; ++xa) {
        const double at_a = column_of_a(volume, xa + jitter.x), at_b = column_of_b(volume, xb + jitter.x);
        if (volume.length_m + at_a - at_b <= 0) continue;  // they diverge
        const glm::dvec3 point_m = meet(volume, at_a, at_b, row(volume, y + jitter.y));
        if (bound.contains(point_m)) take(glm::ivec3(xb, y, r - 1 - xa), point_m);
      }
    }
  }
}
// The number of these calls.
size_t count_meetings(const PairVolume& volume, const Bound& bound, const glm::dvec2& jitter);

}  // namespace sightline
