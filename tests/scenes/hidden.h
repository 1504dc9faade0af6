// Measures with Embree how hard a scenario is to film, for a camera that avoids nothing.
#pragma once

#include <cstddef>
#include <span>

namespace sightline {

// Shares of the frames (15 a second) in which the centre of a target's body is hidden. The camera keeps its first
// offset from the mean of the targets.
struct Hidden {
  double one_or_more = 0;
  double all = 0;
};

// `turning`: the offset turns with the first target, as if the camera were tied to its back. Otherwise the offset keeps
// its direction.
Hidden hidden_from_fixed_offset(std::span<const std::byte> bytes, bool turning);

}  // namespace sightline
