// The acceleration with which a camera begins its flight plan.
//
// A plan (flight_plan.h) flies each leg at one mean speed and turns at once. The camera has a velocity and limits. So
// accelerations in many directions are tried. Each is held until the last slice within 0.35 s. It costs what the slices
// cost at the positions that the camera passes, and what the cheapest plan costs from the position and the time at
// which it ends. Its way, its strength and the velocity to which it leads cost a little too, so that the camera is calm
// where all places are alike. An acceleration that would press the body against a wall is left out: the plan's costs
// between two cells are interpolated, so they do not end at walls.
//
// The result is the mean of all accelerations, with the weights exp(-cost / kTemperatureM). It changes only a little
// where the noise of the maps makes now one of them the cheapest and now another. The plan's own acceleration is among
// them and counts as several: it decides between two sides that are equally good.
//
// The weights are those of path integral control (Williams, Aldrich, Theodorou: Model Predictive Path Integral Control,
// Journal of Guidance, Control, and Dynamics 40, 2017).
#pragma once

#include <functional>
#include <glm/glm.hpp>
#include <optional>

#include "server/move/flight_plan.h"

namespace sightline {

struct AccelerationInput {
  glm::dvec3 position_m{0.0}, velocity_mps{0.0};  // of the camera
  glm::dvec3 group_velocity_mps{0.0};             // of the targets: a velocity costs by its difference from this one
  glm::dvec3 planned_mps2{0.0};  // the acceleration that leads straight to the plan's next point; any length
  double max_speed_mps = 10.0, max_acceleration_mps2 = 10.0;  // > 0
  double first_slice_s = 0.1;                                 // time from the present to the planner's slice 0, > 0
  // Returns whether the body can go straight from `position_m` to a position. Empty: nothing is in the way. It is
  // called for each acceleration that keeps to open cells, about 80 times at most.
  std::function<bool(const glm::dvec3& to_m)> is_free = {};
  // >= 0: cost of the greatest acceleration, in units of the cost of a plan; it grows with the square
  double effort_m = 0.2;
};

// In m/s^2, no longer than the limit. The planner must have made its plan, with `settings`. Empty if no acceleration
// keeps the camera in the lattice's open cells and off the walls. Reads its arguments alone, and allocates nothing.
// Deterministic.
std::optional<glm::dvec3> best_acceleration_mps2(const FlightPlanner& planner, const FlightSettings& settings,
                                                 const AccelerationInput& input);

}  // namespace sightline
