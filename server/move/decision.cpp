#include "server/move/decision.h"

namespace sightline {

MoveReason reason_of(FlightCourse course, const WhatIsSeen& seen) {
  const bool all = seen.from_goal == seen.steered;
  switch (course) {
    case FlightCourse::kStay:
      return MoveReason::kStays;
    case FlightCourse::kToView:
      return MoveReason::kNearestView;
    case FlightCourse::kApproach:
      return MoveReason::kHorizonGrown;
    case FlightCourse::kFarWay:
      return MoveReason::kFarWay;
    case FlightCourse::kToShot:
      return MoveReason::kFarViewpoint;
    case FlightCourse::kFollow:
      if (all) return seen.other_shot ? MoveReason::kOtherShot : MoveReason::kAtDesiredPlace;
      break;
    case FlightCourse::kPlan:
      if (all) return seen.keeps_shot ? MoveReason::kAtDesiredPlace : MoveReason::kBestAllVisible;
  }
  return seen.from_goal != 0 && !seen.somewhere_all ? MoveReason::kBestPartial : MoveReason::kBestSoon;
}

std::string_view explain(MoveReason reason) {
  switch (reason) {
    case MoveReason::kAtDesiredPlace:
      return "all targets are visible from the position that keeps the shot";
    case MoveReason::kNearestAllVisible:
      return "going to the nearest position that sees all targets";
    case MoveReason::kBestAllVisible:
      return "going to the position with the best view of all targets, now and soon";
    case MoveReason::kBestPartial:
      return "no position in reach is known to see all targets; going to the best partial view";
    case MoveReason::kHorizonGrown:
      return "no position in reach is known to see any target; looking farther away";
    case MoveReason::kFarViewpoint:
      return "standing targets are hidden; going to a viewpoint farther away that sees more of them";
    case MoveReason::kOtherShot:
      return "the targets are seen better from another side than the asked one; all of them are visible from there";
    case MoveReason::kBestSoon:
      return "going where the targets are expected to be seen best over the coming second";
    case MoveReason::kStays:
      return "the targets are expected to be seen from here as well as from anywhere in reach; staying";
    case MoveReason::kNearestView:
      return "nothing is seen along the plan; following it toward a position that sees a part of a target";
    case MoveReason::kFarWay:
      return "the targets are out of sight; going through the level to the nearest one";
    case MoveReason::kNoTargets:
      return "no target has a weight";
    case MoveReason::kPaused:
      return "the tick's time step is zero";
    case MoveReason::kBlockedByGeometry:
      return "some positions see the targets, but the camera cannot reach them in a straight line";
    case MoveReason::kBodyOverlap:
      return "the camera body touches a collider or is inside one; leaving it";
    case MoveReason::kObservedCut:
      return "the client moved the camera by a cut";
    case MoveReason::kCut:
      return "jumped to a position that sees the targets";
  }
  return "";
}

std::string_view to_string(TrackingStatus status) {
  switch (status) {
    case TrackingStatus::kTracking:
      return "tracking";
    case TrackingStatus::kPartialView:
      return "partial_view";
    case TrackingStatus::kSeeking:
      return "seeking";
    case TrackingStatus::kBlocked:
      return "blocked";
    case TrackingStatus::kWaiting:
      return "waiting";
    case TrackingStatus::kLost:
      return "lost";
    case TrackingStatus::kHolding:
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
    case MoveReason::kFarViewpoint:
      return "far_viewpoint";
    case MoveReason::kOtherShot:
      return "other_shot";
    case MoveReason::kBestSoon:
      return "best_soon";
    case MoveReason::kStays:
      return "stays";
    case MoveReason::kNearestView:
      return "nearest_view";
    case MoveReason::kFarWay:
      return "far_way";
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
    case MoveReason::kCut:
      return "cut";
  }
  return "";
}

}  // namespace sightline
