// Scenes in which people and footballers move as they were recorded (motion_tracks.h).
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "server/base/error.h"

namespace sightline::scenes {

struct RealMotionOptions {
  uint64_t seed = 1;
  std::string folder = {};  // of the recordings; empty: kMotionVariable names it
};

// Two people, or three with an even seed, walk round the corner of a corridor 3 m wide, one behind the other, among
// others who occlude. The seed selects whom; 14 s. `roofed`: under a ceiling at 2.8 m.
Result<std::vector<std::byte>> make_real_corner(const RealMotionOptions& options, bool roofed);

// An attack that ends in a goal, 9.7 s. The ball and the two players nearest to it are the targets, chosen anew each
// second. The camera starts 25 m from the ball and 15 degrees above it, beyond the side of the pitch that the seed
// selects. It is made for 20 m/s and 15 m/s^2.
Result<std::vector<std::byte>> make_real_attack(const RealMotionOptions& options);

}  // namespace sightline::scenes
