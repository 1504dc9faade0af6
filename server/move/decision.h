// The reason of the move stage's decision and the status of the camera's search for a view, as enums and as text.
#pragma once

#include <string_view>

namespace sightline {

// The targets that the chosen candidate sees. It says nothing about what the camera sees; TrackingStatus does.
enum class MoveStatus {
  kTracking,  // the candidate sees all targets
  kPartial,   // no such candidate in reach: the best partial view
  kEscaping,  // no candidate in reach sees any target: the horizon grows
  kHolding,   // no target has a weight, or no candidate can be taken
};

// Which targets the camera sees from the returned pose. If it sees none, the status says what the camera does about that. "The
// required targets" are all targets with a weight if none of those is required.
enum class TrackingStatus {
  kTracking,     // all required targets are seen
  kPartialView,  // not all of them, but a part of some target
  kSeeking,      // nothing: on the way to a position that is expected to see a target
  kBlocked,      // nothing: such a position is known, but something stands in the way
  kWaiting,      // nothing: such a position is known, but the camera stays, because going there gains nothing
  kLost,         // nothing, and no position is known that sees a target
  kHolding,      // no target has a weight
};

enum class MoveReason {
  kAtDesiredPlace,
  kNearestAllVisible,
  kBestAllVisible,
  kBestPartial,
  kHorizonGrown,
  kOnTrail,
  kFarViewpoint,
  kNoTargets,
  kPaused,
  kBlockedByGeometry,
  kBodyOverlap,
  kObservedCut,
  kCut,
};

// The reason as one sentence: "no position in reach sees all targets; going to the best partial view".
std::string_view explain(MoveReason reason);
std::string_view to_string(TrackingStatus status);
std::string_view to_string(MoveReason reason);

}  // namespace sightline
