// The drive of a vehicle along a line on the ground: corners rounded to arcs, speed limited by the arcs, acceleration
// and brakes.
#pragma once

#include "scenes/path.h"
#include "scenes/scenario_builder.h"

namespace sightline::scenes {

struct DriveLimits {
  double cruise_mps = 20.0;
  double corner_radius_m = 6.0;  // at most half of each leg
  double lateral_mps2 = 6.0;     // in an arc
  double speed_up_mps2 = 4.0;
  double brake_mps2 = 6.0;
  bool stops = false;  // at the end of the line, and stays; otherwise it goes on at its speed
};

// `line` has at least two corners. Starts at the cruising speed, or as fast as the first arc allows.
TimedPath drive_along(const Polyline& line, const DriveLimits& limits);

// A car 4.25 m long, 1.75 m wide and 1.5 m high; its front is towards +z.
MeshData vehicle_mesh(double length_m = 4.25, double height_m = 1.5);

}  // namespace sightline::scenes
