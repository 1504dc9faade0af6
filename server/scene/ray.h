// First hits of rays with one geometry, in its own frame. For work done once for each shape, without Embree and without
// a scene.
#pragma once

#include <array>
#include <cstdint>
#include <glm/glm.hpp>
#include <limits>
#include <vector>

#include "server/scene/geometry.h"

namespace sightline {

struct SurfaceHit {
  double distance = std::numeric_limits<double>::infinity();  // in multiples of the direction's length
  glm::dvec3 point_m{0.0};                                    // on the triangle, mesh frame
  uint32_t first_index = 0;                                   // of the triangle, in Geometry::indices
  bool hit() const { return distance < std::numeric_limits<double>::infinity(); }
};

// Traces rays against all triangles of a geometry, including see-through ones. Holds a copy of the triangles in a
// layout that tests four at once, and refers to the geometry, which must outlive it. Immutable: any number of threads
// may use it.
//
// Triangles are tested in single precision relative to the centre of the geometry's bounding sphere (Moeller &
// Trumbore, "Fast, minimum storage ray/triangle intersection", 1997). The error is about 1e-6 of the bounding radius or
// of the origin's distance from the centre, whichever is larger. A ray that passes an edge nearer than that may fall on
// either side of it, even between two triangles.
class RayCaster {
 public:
  explicit RayCaster(const Geometry& geometry);

  // The first hit in front of the origin, of either side of a triangle. `direction` is not zero.
  SurfaceHit first_hit(const glm::dvec3& origin_m, const glm::dvec3& direction) const;

  const Geometry& geometry() const { return geometry_; }

 private:
  struct Ray;
  struct Nearest;
  void search(const TriangleTree& tree, const Ray& ray, Nearest& nearest) const;
  void test_cluster(const TreeNode& leaf, const Ray& ray, Nearest& nearest) const;

  SurfaceHit exactly(const glm::dvec3& origin_m, const glm::dvec3& direction, const Nearest& nearest) const;

  const Geometry& geometry_;
  // Corner a, edges ab and ac of every triangle, relative to the centre: nine rows, one coordinate each.
  std::array<std::vector<float>, 9> rows_;
};

// True if the geometry's surface crosses the straight line between two points, given in its frame. Either side of any
// triangle counts, the see-through ones included. A crossing within a millionth of the line's length of `to_m` does
// not. It needs no RayCaster, and tests triangles one by one.
bool crosses(const Geometry& geometry, const glm::dvec3& from_m, const glm::dvec3& to_m);

}  // namespace sightline
