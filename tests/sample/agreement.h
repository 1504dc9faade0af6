// Decides when two depth maps agree, and whether a silhouette excuses a texel in which they differ.
#pragma once

#include <span>
#include <vector>

#include "server/sample/depth_map.h"
#include "server/sample/embree_scene.h"

namespace sightline::test {

// The same occluder, at the same distance within `relative` of it plus `absolute_m`.
struct Tolerance {
  double relative = 1e-4;
  double absolute_m = 1e-5;
};
bool texels_agree(const DepthMap& a, const DepthMap& b, size_t texel, const Tolerance& tolerance = {});

// True when rays through the footprint of texel (x, y) hit different instances or jump in depth. The rays are a coarse
// grid over the whole footprint and two fine ones about its sample point.
bool has_silhouette(const EmbreeScene& scene, const MapRequest& request, int x, int y);

// Compares EGL's maps with Embree's. Every difference is checked with `scene`, an Embree scene of the same mirror.
struct Agreement {
  size_t texels = 0;
  size_t hits = 0;  // texels in which something is seen
  size_t different = 0;
  size_t unexcused = 0;  // different, and no silhouette in the footprint
  double share() const { return 1.0 - static_cast<double>(different) / static_cast<double>(texels); }
  void add(const EmbreeScene& scene, std::span<const MapRequest> requests, std::span<const DepthMap> egl,
           std::span<const DepthMap> embree, const Tolerance& tolerance = {});
};

}  // namespace sightline::test
