// Chooses the targets that the camera shows, where it cannot show all of them together: they stand too far apart for
// the picture.
//
// The targets that are kept have the greatest total weight of required targets, then of optional ones. The choice
// nearest to the camera wins among equal ones. Others are given up until all can be shown together again. The choice
// changes only for a greater weight, and only if there is room to spare, so the camera does not turn to and fro.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <glm/glm.hpp>
#include <span>

#include "server/scene/target.h"

namespace sightline {

// Returns whether the targets with a weight can be shown together. `room` in (0, 1] is the share of the available room
// that they may use.
using FitTogether = std::function<bool(std::span<const TrackedTarget> targets, double room)>;

// Room that targets may use which were not shown together before.
inline constexpr double kRoomToReturn = 0.9;

// Returns the mask of the targets to keep; bit i is target i. It holds at least one target, if any has a weight. A
// target without a weight is never kept. There are at most kMaxTargets.
//   former:  mask of the targets that were kept at the last step. A new target counts as kept.
// If all of them fit together, `fit` is called once.
uint32_t keep_together(std::span<const TrackedTarget> targets, const glm::dvec3& camera_m, uint32_t former,
                       const FitTogether& fit);

// The targets with the weights of those outside `kept` set to 0. Uses `memory`, which must outlive the result.
using TargetMemory = std::array<TrackedTarget, kMaxTargets>;
std::span<const TrackedTarget> only_kept(std::span<const TrackedTarget> targets, uint32_t kept, TargetMemory& memory);

}  // namespace sightline
