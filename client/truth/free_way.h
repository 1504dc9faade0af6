// Finds out whether a camera that sees no target had a way to see one. The search runs on a plain grid and shares no
// code with the camera's own routes.
//
// The grid's cells are cubes, and one of them is centred at the camera. A cell is free when the body, a sphere, can go
// from its centre to the centres of the free cells beside it. Its centre is then at least sqrt(r^2 + h^2 / 4) away from
// every collider, for a body radius r and cells of h metres. The search goes breadth-first from the camera's cell
// through the faces of free cells. A free way ends in a free cell from whose centre nothing lies on the straight line
// to the aim point of some target, other than that target. Everything stands where it is at the time of the search.
//
// The search is cautious. The sides of the cells make its ways up to 1.7 times too long. It misses gaps
// that are less than about a cell wider than the body. So a way that it finds is one; a way that it does not find may
// exist.
#pragma once

#include <optional>
#include <span>

#include "client/scenario/scenario_world.h"
#include "client/truth/judge.h"
#include "server/settings/camera_limits.h"

namespace sightline {

struct FreeWay {
  double length_m = 0.0;  // along the sides of the cells
  glm::dvec3 end_m{0.0};  // world; sees the target
  uint64_t target_id = 0;
};
// The shortest free way of at most `reach_m` in the present state of `world`; none when there is none. `body_radius_m`
// > 0: cells are as large, but at least 0.1 m. Time and memory grow with the cube of reach_m / body_radius_m: in the
// open, less than 0.1 s and 1 MB at 50.
std::optional<FreeWay> find_free_way(const ScenarioWorld& world, const glm::dvec3& from_m, double body_radius_m,
                                     double reach_m);

// A free way counts when a camera that starts at rest can be at its end within this time, by its limits.
inline constexpr double kFreeWayS = 2.0;
// Within a blind stretch (blindness.h), the search is made at its first picture and again at the first picture at least
// this much later. Its result is taken to hold until the next search.
inline constexpr double kFreeWayEveryS = 0.5;

// How far a camera at rest gets in `time_s` by its limits, in metres.
double reach_from_rest_m(const CameraLimits& limits, double time_s);

// The longest time without a break, in seconds, in which the camera saw no target although a free way existed. Only as
// many stretches are searched as can decide it. `world` must have a target; its time is left anywhere. `truths` is as
// long as `frames`.
double longest_blind_with_way_s(ScenarioWorld& world, std::span<const CameraFrame> frames,
                                std::span<const FrameTruth> truths, const CameraLimits& limits);

}  // namespace sightline
