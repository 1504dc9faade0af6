#include "tests/sample/agreement.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace sightline::test {
namespace {

constexpr int kGrid = 17;

struct Sample {
  uint32_t slot;
  double inverse_depth;  // affine in window coordinates on a plane; 0 = nothing
};
using Line = std::array<Sample, kGrid>;

Sample look(const EmbreeScene& scene, const MapRequest& request, double u, double v) {
  MapView view = request.view;
  view.jitter = {u, v};  // texel (0, 0) with the jitter carrying the whole texel coordinate
  const RayHit hit = scene.trace(
      view.eye_m, glm::vec3(texel_direction(view, 0, 0)), static_cast<float>(view.near_m),
      std::numeric_limits<float>::infinity(),
      {.layer_mask = request.layer_mask, .ignored_slots = request.ignored_slots, .ahead = request.ahead_s > 0});
  return {hit.slot, hit.slot == UINT32_MAX ? 0.0 : 1.0 / hit.distance_m};
}

// A step that stands out from the steps on both sides is a jump; a crease only changes the slope.
bool jumps(const Line& line) {
  for (size_t i = 0; i + 1 < line.size(); ++i) {
    if (line[i].slot != line[i + 1].slot) return true;
    const auto step = [&](size_t j) { return std::abs(line[j + 1].inverse_depth - line[j].inverse_depth); };
    const double around = std::max(i > 0 ? step(i - 1) : 0.0, i + 2 < line.size() ? step(i + 1) : 0.0);
    if (step(i) > 3.0 * around + 3e-5 * line[i].inverse_depth) return true;
  }
  return false;
}

// A grid over the square of `size` texels about (u, v).
bool silhouette_within(const EmbreeScene& scene, const MapRequest& request, double u, double v, double size) {
  std::array<Line, kGrid> rows, columns;
  for (int j = 0; j < kGrid; ++j)
    for (int i = 0; i < kGrid; ++i) {
      const Sample sample = look(scene, request, u + size * (i / (kGrid - 1.0) - 0.5),
                                 v + size * (j / (kGrid - 1.0) - 0.5));
      rows[j][i] = sample;
      columns[i][j] = sample;
    }
  return std::ranges::any_of(rows, jumps) || std::ranges::any_of(columns, jumps);
}

}  // namespace

bool texels_agree(const DepthMap& a, const DepthMap& b, size_t texel, const Tolerance& tolerance) {
  if (a.occluder[texel] != b.occluder[texel]) return false;
  if (a.occluder[texel] == kNoOccluder) return std::isinf(a.distance_m[texel]) && std::isinf(b.distance_m[texel]);
  return std::abs(double{a.distance_m[texel]} - b.distance_m[texel]) <=
         tolerance.relative * b.distance_m[texel] + tolerance.absolute_m;
}

bool has_silhouette(const EmbreeScene& scene, const MapRequest& request, int x, int y) {
  const double u = x + request.view.jitter.x, v = y + request.view.jitter.y;
  return silhouette_within(scene, request, u, v, 1.0 / 256) || silhouette_within(scene, request, u, v, 1.0 / 32) ||
         silhouette_within(scene, request, x + 0.5, y + 0.5, 1.0);
}

void Agreement::add(const EmbreeScene& scene, std::span<const MapRequest> requests, std::span<const DepthMap> egl,
                    std::span<const DepthMap> embree, const Tolerance& tolerance) {
  for (size_t i = 0; i < requests.size(); ++i) {
    const int width = requests[i].view.width;
    for (size_t texel = 0; texel < embree[i].occluder.size(); ++texel) {
      ++texels;
      hits += embree[i].occluder[texel] != kNoOccluder;
      if (texels_agree(egl[i], embree[i], texel, tolerance)) continue;
      ++different;
      unexcused += !has_silhouette(scene, requests[i], static_cast<int>(texel) % width,
                                   static_cast<int>(texel) / width);
    }
  }
}

}  // namespace sightline::test
