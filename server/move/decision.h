// The reason of the move stage's decision and the status of the camera's search for a view, as enums and as text.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace sightline {

// The targets that the chosen candidate sees. It says nothing about what the camera sees; TrackingStatus does.
enum class MoveStatus {
  kTracking,  // the candidate sees all targets
  kPartial,   // no such candidate in reach: the best partial view
  kEscaping,  // no candidate in reach sees any target: the horizon grows
  kHolding,   // no target has a weight, or no candidate can be taken
};

// Which targets the camera sees from the returned pose. If it sees none, the status says what the camera does about
// that. "The required targets" are all targets with a weight if none of those is required.
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
  kFarViewpoint,
  kOtherShot,
  kBestSoon,
  kStays,
  kNearestView,
  kFarWay,
  kNoTargets,
  kPaused,
  kBlockedByGeometry,
  kBodyOverlap,
  kObservedCut,
  kCut,
};

// The courses of a camera with a flight plan (step/goal_search.cpp).
enum class FlightCourse {
  kFollow,    // to the desired position
  kStay,      // where it is
  kPlan,      // along the flight plan
  kToView,    // along the plan, which shows no target, toward a place beyond its end that does
  kFarWay,    // none in reach does, or none has been seen for long: through the level to the nearest target
  kApproach,  // none in reach does, and no way is known: nearer to the desired position
  kToShot,    // through a time of less sight to the wanted shot of targets that stand
};
// The courses that a decision compared. A loss is the cost of a course over the coming 1.2 s, as a share of what it
// costs to see no target all that time. It holds what pictures are expected to lack, and how far they depart from the
// shot. It also holds the distance from the wanted place and the length of the way, so it may exceed 1, up to
// kMostLoss.
inline constexpr double kMostLoss = 1000.0;
struct ComparedCourses {
  std::optional<FlightCourse> taken;                        // empty: the camera has no flight plan
  std::optional<double> follow_loss, stay_loss, plan_loss;  // empty: not compared, or the way is blocked
};
// How long each fact behind a plan's reason has held, in seconds, at most kFactHoldsS. The maps of two decisions differ
// by a few texels, and a reason that changed with them would tell a person nothing.
struct HeldFacts {
  double goal_sees_all_s = 0.0, goal_keeps_shot_s = 0.0, none_sees_all_s = 0.0;
};
inline constexpr double kFactHoldsS = 0.3;  // the reason of a plan says what has held for this time

struct WhatIsSeen {
  uint32_t from_goal = 0;      // the targets that the goal's candidate sees, one bit each
  uint32_t steered = 0;        // all that count
  bool somewhere_all = false;  // some candidate sees all of them
  bool other_shot = false;     // the wanted shot is not the client's own
  bool keeps_shot = false;     // the goal departs from the client's shot by no more than its free bands
};
// The reason that is true of a course.
MoveReason reason_of(FlightCourse course, const WhatIsSeen& seen);

// The reason as one sentence: "no position in reach is known to see all targets; going to the best partial view".
std::string_view explain(MoveReason reason);
std::string_view to_string(TrackingStatus status);
std::string_view to_string(MoveReason reason);

}  // namespace sightline
