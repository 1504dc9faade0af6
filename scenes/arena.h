// Arena: two to eight targets run around obstacles inside a ring wall, while carts and screens circle them. It tests
// more than two targets, and the choice of the target to lose when not all can be seen.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace sightline::scenes {

struct ArenaOptions {
  uint64_t seed = 1;
  double duration_s = 20.0;  // [1, 600]
  int targets = 4;           // [2, 8]
};

// A .glb file.
std::vector<std::byte> make_arena(const ArenaOptions& options);

}  // namespace sightline::scenes
