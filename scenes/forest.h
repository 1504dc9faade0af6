// Forest: two targets walk a winding path, sometimes closer and sometimes farther apart, between 350 to 400 trees. It
// tests many thin and some thick occluders all around, none of which hides a target for long, and crowns that block the
// view from above.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace sightline::scenes {

struct ForestOptions {
  uint64_t seed = 1;
  double duration_s = 30.0;  // [1, 600]; the forest is as long as the walk needs
  double spacing_m = 2.25;   // [2, 10]: mean distance from a tree to the next
  double low_share = 0.3;    // [0, 1]: trees whose crown begins at the knee: what they hide, they hide at eye height
};

// A .glb file. Trunks occlude and collide; crowns occlude, and the camera may pass through them.
std::vector<std::byte> make_forest(const ForestOptions& options);

}  // namespace sightline::scenes
