// Crowd: two targets walk around a plaza with a few columns, and up to 35 others walk across their path and between
// them and the camera. It tests short occlusions from all sides that cannot be predicted from the geometry.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace sightline::scenes {

struct CrowdOptions {
  uint64_t seed = 1;
  double duration_s = 20.0;     // [1, 600]
  int movers = 20;              // [0, 35]
  bool movers_collide = false;  // with the camera
};

// A .glb file. Movers keep clear of the targets, the columns and each other; they occlude. The targets' walk
// and the columns depend on the seed alone, and a smaller crowd is the first part of a larger one.
std::vector<std::byte> make_crowd(const CrowdOptions& options);

}  // namespace sightline::scenes
