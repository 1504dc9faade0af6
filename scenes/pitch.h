// Pitch: a football pitch of 105 m x 68 m with 22 players and a ball. Two players run and pass the ball to each other.
// These two and the ball are the targets. The other 20 players move with the game and occlude. It tests a small, fast
// target beside large ones.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace sightline::scenes {

struct PitchOptions {
  uint64_t seed = 1;
  double duration_s = 40.0;  // [1, 600]
};

// A .glb file. Players run at up to 6 m/s, and the ball flies at 12 m/s, up to 2.6 m high. The camera is made for it:
// 20 m/s, 15 m/s^2.
std::vector<std::byte> make_pitch(const PitchOptions& options);

}  // namespace sightline::scenes
