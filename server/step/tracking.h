// How the camera carries out a decision in the steps until the next one (Tuning.move.decide_every_s).
//
// A decision looks at every candidate and at the coming second. Between two decisions the camera goes on with the same
// course, relative to where the targets are now. All are plain values. Lengths are metres, world frame unless a comment
// says otherwise.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <optional>

#include "server/aggregate/compose.h"
#include "server/base/inline_vector.h"
#include "server/move/decision.h"
#include "server/scene/target.h"

namespace sightline {

// The next position to head for, and the length of the way from the camera over that position to its end.
struct Leg {
  glm::dvec3 to_m{0.0};
  double length_m = 0;
};

// How the camera hurries along a leg. By default it is as quick as MoveSettings and the limits allow.
struct Pace {
  double response = 1;  // time constant of its velocity, in units of move_response_s
  double closing = 1;   // time constant in which it closes the last of its distance, in the same units
  double braking = 1;   // what it brakes with before the end, as a share of the greatest acceleration
};

enum class TrackBy {
  kStop,          // it comes to rest
  kStay,          // it stays where it is
  kFollow,        // to a place beside the desired position, with the velocity of the targets
  kLeg,           // along a leg in the world
  kVelocity,      // at a velocity
  kAcceleration,  // with an acceleration
};
struct Tracking {
  TrackBy by = TrackBy::kStop;
  Pace pace = {};
  // kFollow: from the desired position to the place. kLeg: the end of the leg, world. kVelocity: m/s. kAcceleration:
  // m/s².
  glm::dvec3 vector{0.0};
  double beyond_m = 0.0;  // kFollow, kLeg: length of the way after the place or the leg
};

// The last decision, as far as later steps need it.
struct DecisionInForce {
  double age_s = 0.0;    // the time that the camera has moved for since
  double clock_s = 0.0;  // the time that it has moved for since the session opened
  // The number of decisions of a camera that moves since there were no targets. By it, the targets take turns.
  uint64_t made = 0;
  bool is_due = true;  // the next step decides, however young the last decision is
  Tracking tracking;
  MoveStatus status = MoveStatus::kHolding;
  MoveReason reason = MoveReason::kNoTargets;  // as Decision::course_reason
  ComparedCourses courses;
  HeldFacts facts;
  std::optional<double> view_way_m;                // as Decision::view_way_m
  bool sees_none = false;                          // as Decision::sees_none
  std::optional<glm::dvec3> nearest_view_m;        // as Decision::nearest_view_m
  SightCounts counts;                              // of the candidates
  InlineVector<uint64_t, kMaxTargets> target_ids;  // in the order of the input
  uint32_t seen = 0;  // of these, those that the camera has seen over the last steps, by the filter; bit i is target i
};

}  // namespace sightline
