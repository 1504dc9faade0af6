// Lift: a tower of four storeys with a gallery each, open to one side, and a lift whose cabin has no door. One target
// rides up, looks round, rides on and gets out. It tests a place that carries its walls with it: a camera rides along,
// or goes round outside.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace sightline::scenes {

struct LiftOptions {
  uint64_t seed = 1;
  double duration_s = 45.0;  // [1, 600]
};

// A .glb file. The cabin is 2.4 m wide and deep and 2.5 m high; it occludes and collides, and moves at 2 m/s.
std::vector<std::byte> make_lift(const LiftOptions& options);

}  // namespace sightline::scenes
