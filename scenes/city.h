// City (the 280 K triangles of the paper's Table 1): 30 blocks with 240 buildings that have real window recesses, and
// streets with trees, lamps and parked cars. Two targets walk along a street and around a corner while two vans drive
// past. It tests cost. The number of triangles is the same for every seed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace sightline::scenes {

struct CityOptions {
  uint64_t seed = 1;
  // [12, 24]: the corner is reached after about 10 s, the end of the way after 25 s.
  double duration_s = 20.0;
};

// A .glb file. Meshes are shared: it stores a tenth of the triangles that it shows.
std::vector<std::byte> make_city(const CityOptions& options);

}  // namespace sightline::scenes
