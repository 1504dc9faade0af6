// Vehicles as targets: a car in a grid of streets, and one that drives round a large block and waits behind it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace sightline::scenes {

struct StreetOptions {
  uint64_t seed = 1;
  double duration_s = 40.0;  // [5, 120]
  double cruise_mps = 0.0;   // [10, 30]; 0: chosen by the seed between 15 and 30
  int traffic = 16;          // [0, 40] other vehicles, 10 to 20 m/s; they occlude and do not collide
};

// A car drives at its cruising speed between houses and turns at random crossings of a 6 x 6 grid. The camera is made
// for it: 40 m/s, 20 m/s^2. A .glb file.
std::vector<std::byte> make_street(const StreetOptions& options);

struct BlockOptions {
  uint64_t seed = 1;
  double duration_s = 50.0;  // [20, 600]
};

// A car rounds one or two corners of a block of 120 m x 120 m x 20 m at 20 m/s, stops behind it and waits. The camera's
// speed is the default, half of that. A .glb file.
std::vector<std::byte> make_block(const BlockOptions& options);

}  // namespace sightline::scenes
