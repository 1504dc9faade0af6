// Buildings whose windows are recesses in the wall, so that they have as many triangles as a real facade.
#pragma once

#include "server/scene/geometry.h"

namespace sightline::scenes {

struct BuildingPlan {
  int floors = 4;
  int windows = 4;        // on each floor of each of the four sides
  double side_m = 12.0;   // square footprint
  double floor_m = 3.25;  // height of a floor
};

// Standing on y = 0, centred on the origin in x and z. 72 triangles a floor and window, and 26 for roof and
// parapet.
MeshData make_building(const BuildingPlan& plan);

}  // namespace sightline::scenes
