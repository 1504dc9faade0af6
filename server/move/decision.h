// The decision of stage `move`, for people and programs.
#pragma once

#include <string_view>

namespace sightline {

enum class MoveStatus {
  kTracking,  // going to, or at, a place that sees all targets
  kPartial,   // no such place in reach: going where the best of them are seen
  kEscaping,  // no place in reach sees any: the horizon grows
  kHolding,   // nothing to steer for, or nowhere to go
};

enum class MoveReason {
  kAtDesiredPlace,
  kNearestAllVisible,
  kBestAllVisible,
  kBestPartial,
  kHorizonGrown,
  kOnTrail,
  kNoTargets,
  kPaused,
  kBlockedByGeometry,
  kBodyOverlap,
  kObservedCut,
};

// One sentence: "no place in reach sees all targets; going where the best of them are seen".
std::string_view explain(MoveReason reason);
std::string_view to_string(MoveStatus status);
std::string_view to_string(MoveReason reason);

}  // namespace sightline
