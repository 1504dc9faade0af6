// Roofs: two to four people, 1.5 to 5 m apart, in a furnished room or a corridor under a low ceiling. It tests whether
// a camera shows all of them whole from a little above their eyes. Above them there is no room for a picture: right
// under the ceiling it shows heads and cuts the bodies off.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace sightline::scenes {

struct RoofsOptions {
  uint64_t seed = 1;
  double duration_s = 20.0;  // [1, 600]
  int people = 2;            // [2, 4]
  bool walk = false;         // each a way of its own; else they stand
  bool corridor = false;     // 3 m wide instead of the room; two people only
  // between neighbours: [1.5, 5]; 0: 1.5 m with seed 1, and 0.5 m more with each further seed, up to 5 m, then again
  double gap_m = 0.0;
  double ceiling_m = 0.0;  // [2.5, 4]; 0: 2.5, 2.75, 3.25 and 4 m, one seed after the other
};

// A .glb file.
std::vector<std::byte> make_roofs(const RoofsOptions& options);

}  // namespace sightline::scenes
