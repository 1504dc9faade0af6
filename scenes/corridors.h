// Corridors: passages 2 m wide and 2.8 m high under a ceiling, with right-angled corners and side passages
// that end blind; two targets walk one behind the other. What it tests: nothing is seen around a corner that
// the camera has not turned as well, and there is no way but theirs.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace sightline::scenes {

struct CorridorsOptions {
  uint64_t seed = 1;
  double duration_s = 30.0;   // [1, 600]
  double blind_share = 0.35;  // [0, 1]: of the places where a side passage has room, how many have one
};

// A .glb file.
std::vector<std::byte> make_corridors(const CorridorsOptions& options);

}  // namespace sightline::scenes
