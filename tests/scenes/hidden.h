// How hard a scenario is to film, measured with Embree on a camera that does nothing clever.
#pragma once

#include <cstddef>
#include <span>

namespace sightline {

// Shares of the frames (15 a second) in which the middle of a target's body is hidden from a camera that
// never leaves the place that it had at first, measured from the targets' middle.
struct Hidden {
  double one_or_more = 0;
  double all = 0;
};

// `turning`: the place turns with the first target, as that of a camera tied to its back; else it only moves
// along.
Hidden hidden_from_fixed_offset(std::span<const std::byte> bytes, bool turning);

}  // namespace sightline
