// The status and the reason of the move stage's decision, as enums and as text.
#pragma once

#include <string_view>

namespace sightline {

enum class MoveStatus {
  kTracking,  // going to, or at, a position that sees all targets
  kPartial,   // no such position in reach: going to the best partial view
  kEscaping,  // no position in reach sees any target: the horizon grows
  kHolding,   // no target has a weight, or no candidate can be taken
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
  kCut,
};

// The reason as one sentence: "no position in reach sees all targets; going to the best partial view".
std::string_view explain(MoveReason reason);
std::string_view to_string(MoveStatus status);
std::string_view to_string(MoveReason reason);

}  // namespace sightline
