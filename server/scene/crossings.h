// All places where a ray crosses the surface of a geometry, in the geometry's frame. It tests triangles one by one in
// double precision (Moeller & Trumbore, "Fast, minimum storage ray/triangle intersection", 1997).
#pragma once

#include <functional>
#include <glm/glm.hpp>
#include <vector>

#include "server/scene/geometry.h"

namespace sightline {

struct Crossing {
  double distance = 0.0;   // in multiples of the direction's length
  bool from_back = false;  // the ray leaves what the surface encloses
};

// Calls visit(crossing) for each crossing at a distance in [0, end), in no particular order, until it returns false.
// Both sides of all triangles count, those of see-through triangles too.
void visit_crossings(const Geometry& geometry, const glm::dvec3& origin_m, const glm::dvec3& direction, double end,
                     const std::function<bool(const Crossing&)>& visit);

// All of them, the nearest first.
std::vector<Crossing> all_crossings(const Geometry& geometry, const glm::dvec3& origin_m, const glm::dvec3& direction);

}  // namespace sightline
