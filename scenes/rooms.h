// Rooms: nine rooms, three by three, without a ceiling. Two targets walk one behind the other through the doors from
// room to room. It tests narrow openings that the camera has to pass, and walls that leave only one way to see.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace sightline::scenes {

struct RoomsOptions {
  uint64_t seed = 1;
  double duration_s = 30.0;    // [1, 600]
  int furniture_per_room = 3;  // [0, 10]: tries; a piece that would stand in the way is left out
};

// A .glb file.
std::vector<std::byte> make_rooms(const RoomsOptions& options);

}  // namespace sightline::scenes
