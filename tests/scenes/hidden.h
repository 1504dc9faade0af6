// How hard a scenario is to film: measured with Embree for a camera that avoids nothing.
#pragma once

#include <cstddef>
#include <span>

namespace sightline {

// Shares of the frames (15 a second) in which the middle of a target's body is hidden from a camera that keeps its first offset from
// the targets' middle.
struct Hidden {
  double one_or_more = 0;
  double all = 0;
};

// `turning`: the offset turns with the first target, as if the camera were tied to its back; else it stays parallel to itself.
Hidden hidden_from_fixed_offset(std::span<const std::byte> bytes, bool turning);

}  // namespace sightline
