#include "server/move/decision.h"

namespace sightline {

std::string_view explain(MoveReason reason) {
  switch (reason) {
    case MoveReason::kAtDesiredPlace:
      return "all targets are seen from the place that keeps the shot";
    case MoveReason::kNearestAllVisible:
      return "going to the nearest place that sees all targets";
    case MoveReason::kBestAllVisible:
      return "going to the place that sees all targets best, now and soon";
    case MoveReason::kBestPartial:
      return "no place in reach sees all targets; going where the best of them are seen";
    case MoveReason::kHorizonGrown:
      return "no place in reach sees any target; looking further";
    case MoveReason::kOnTrail:
      return "no place in reach sees any target; going the way that they went";
    case MoveReason::kNoTargets:
      return "no target to steer for";
    case MoveReason::kPaused:
      return "the tick's time step is zero";
    case MoveReason::kBlockedByGeometry:
      return "places see the targets, but the camera cannot go there straight";
    case MoveReason::kBodyOverlap:
      return "the camera body touches a collider; backing out";
    case MoveReason::kObservedCut:
      return "the client placed the camera by a cut";
  }
  return "";
}

std::string_view to_string(MoveStatus status) {
  switch (status) {
    case MoveStatus::kTracking:
      return "tracking";
    case MoveStatus::kPartial:
      return "partial";
    case MoveStatus::kEscaping:
      return "escaping";
    case MoveStatus::kHolding:
      return "holding";
  }
  return "";
}

std::string_view to_string(MoveReason reason) {
  switch (reason) {
    case MoveReason::kAtDesiredPlace:
      return "at_desired_place";
    case MoveReason::kNearestAllVisible:
      return "nearest_all_visible";
    case MoveReason::kBestAllVisible:
      return "best_all_visible";
    case MoveReason::kBestPartial:
      return "best_partial";
    case MoveReason::kHorizonGrown:
      return "horizon_grown";
    case MoveReason::kOnTrail:
      return "on_trail";
    case MoveReason::kNoTargets:
      return "no_targets";
    case MoveReason::kPaused:
      return "paused";
    case MoveReason::kBlockedByGeometry:
      return "blocked_by_geometry";
    case MoveReason::kBodyOverlap:
      return "body_overlap";
    case MoveReason::kObservedCut:
      return "observed_cut";
  }
  return "";
}

}  // namespace sightline
