// Corridors: passages 2 m wide and 2.8 m high under a ceiling, with right-angled corners and dead ends. Two targets
// walk one behind the other. It tests corners: a camera sees around a corner only after it has turned the corner
// itself, and there is no other way.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace sightline::scenes {

struct CorridorsOptions {
  uint64_t seed = 1;
  double duration_s = 30.0;   // [1, 600]
  double width_m = 2.0;       // [1, 2.5]: of the passages
  int targets = 2;            // 1 or 2
  double blind_share = 0.35;  // [0, 1]: of the places where a side passage has room, how many have one
};

// A .glb file.
std::vector<std::byte> make_corridors(const CorridorsOptions& options);

}  // namespace sightline::scenes
