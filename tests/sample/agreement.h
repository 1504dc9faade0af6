// When two depth maps say the same, and whether a texel where they do not is excused by a silhouette.
#pragma once

#include <span>
#include <vector>

#include "server/sample/depth_map.h"
#include "server/sample/embree_scene.h"

namespace sightline::test {

// Same occluder, and the same distance within `relative` of it plus `absolute_m`.
struct Tolerance {
  double relative = 1e-4;
  double absolute_m = 1e-5;
};
bool texels_agree(const DepthMap& a, const DepthMap& b, size_t texel, const Tolerance& tolerance = {});

// True when rays through the footprint of texel (x, y), on a coarse grid over all of it and two fine ones about its
// sample point, hit different instances or jump in depth.
bool has_silhouette(const EmbreeScene& scene, const MapRequest& request, int x, int y);

// Compares EGL's maps with Embree's, and every difference with `scene`, Embree's own of the same mirror.
struct Agreement {
  size_t texels = 0;
  size_t hits = 0;         // texels in which something is seen
  size_t different = 0;
  size_t unexcused = 0;    // different, and no silhouette in the footprint
  double share() const { return 1.0 - static_cast<double>(different) / static_cast<double>(texels); }
  void add(const EmbreeScene& scene, std::span<const MapRequest> requests, std::span<const DepthMap> egl,
           std::span<const DepthMap> embree, const Tolerance& tolerance = {});
};

}  // namespace sightline::test
