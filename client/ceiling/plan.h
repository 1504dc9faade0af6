// The best that a camera could do in a scenario if it knew all of it in advance: `sightline evaluate --policy ceiling`.
//
// The plan is made in two parts. A dynamic program over free places and time (costs_to_go.h), backwards from the end,
// finds in how many pictures all targets can still be shown from where. Then a beam search (beam.h) finds a motion that
// keeps all limits exactly, with the dynamic program as its guide. The judge's figures of that motion were reached, so
// the true ceiling is no lower. A plan for kWorth is made in the same way, and pays for what each picture loses against
// the first one's shot. `most` is the other end of the interval: a second dynamic program with the benefit of the doubt
// throughout. Its camera keeps the acceleration limit only at its start, may be faster than the speed limit, and sees a
// target although some of its points are hidden. For kWorth such a target counts with the rays that arrive.
//
// That end is an estimate on a grid, not a proof: a view that exists only between the grid's places, or beyond its
// reach, is not found.
#pragma once

#include <vector>

#include "client/ceiling/beam.h"
#include "client/scenario/scenario_world.h"
#include "server/sample/extent.h"
#include "server/settings/camera_limits.h"
#include "server/settings/move_settings.h"

namespace sightline {

struct PlanOptions {
  double spacing_m = 0.5;  // > 0; edge of the grid's cells where targets are near
  // The grid ends at this distance from the path of the targets' centre, plus twice the distance of a target from the
  // centre. If the camera's start is farther away, it ends 2 m beyond the start.
  double reach_m = 10.0;
  double near_m = 5.0;  // beyond this distance only every second place in each direction is looked from
  size_t rays = 8;      // to each target from each place
  // The guide's camera needs no time to accelerate. Along an axis it has this speed, or that of the targets' centre if
  // that is greater, up to the speed limit. Faster than a camera can be on average, it would promise what cannot be
  // kept.
  double guide_speed_mps = 3.5;
  PlanAim aim = PlanAim::kJoint;
  size_t most_places = 200'000;
  BeamOptions beam;
};

struct CeilingPlan {
  std::vector<Pose> path;  // by tick
  double joint = 0.0;      // share of the stages that show all targets, by the judge's pictures
  double most = 1.0;       // the upper estimate: of `joint`, or of the mean worth of the stages' pictures
  size_t places = 0;
};

// The plan for one camera in one scenario. `place_limits` are the distances and elevations at which a picture counts;
// the camera may be elsewhere on its way. A pure function of its arguments. Fails only when the scenario's scene cannot
// be made.
Result<CeilingPlan> plan_ceiling(const Scenario& scenario, GeometryStore& store, EmbreeDevice& device,
                                 ExtentCache& extents, const Timeline& timeline, const CameraLimits& limits,
                                 const MoveSettings& place_limits, const PlanOptions& options = {});

// The stages of a run of `ticks` ticks of which every `ticks_per_picture`-th is judged. Stages are at most 0.125 s
// apart where the ticks allow it. Each stage is a judged tick, or each judged tick is a stage; only where stages would
// be shorter than 0.05 s it is not so.
Timeline timeline_of(double tick_s, size_t ticks, size_t ticks_per_picture);

}  // namespace sightline
