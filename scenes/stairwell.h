// Stairwell: four storeys of stairs that turn back at every half storey, in a closed shaft, and a lobby below. One
// target walks up from the lobby. It tests a way that leads over itself: the shortest line to the target is through a
// flight of stairs.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace sightline::scenes {

struct StairwellOptions {
  uint64_t seed = 1;
  double duration_s = 40.0;  // [1, 60]
};

// A .glb file. Flights are 1.4 m wide with 0.8 m between them, 3.2 m of rise a storey.
std::vector<std::byte> make_stairwell(const StairwellOptions& options);

}  // namespace sightline::scenes
