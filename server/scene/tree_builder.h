// Builds a TriangleTree from the top down with a binned surface-area heuristic (Wald, "On fast construction of
// SAH-based bounding volume hierarchies", 2007). The cost counts clusters instead of triangles, so that leaves are well
// filled.
//
// meshoptimizer, which is linked for packed files, makes clusters too, but its boxes are looser: meshlets follow the
// surface, so that vertices are shared, and grow round corners. Measured over the city scene (282 K triangles, 7 x 7
// maps from the streets): triangles in clusters that a map cannot rule out, and time relative to this builder, which
// includes its tree and the checks, hash and welding of the geometry:
//                    mesh by mesh     as one mesh
//   this builder      2,355   1.0      2,415   1.0
//   meshlets          3,204   9.9      3,566   2.8
//   spatial sort      4,249   0.5      5,552   0.2
#pragma once

#include <cstdint>
#include <span>

#include "server/scene/geometry.h"

namespace sightline {

// One triangle to be put into a tree.
struct TreePart {
  Aabb bounds;
  uint32_t triangle = 0;  // in the mesh as given
};

// Sorts `parts` by cluster and builds the tree over them. Triangle k in the new order has the indices
// [first_index + 3 k, first_index + 3 k + 3). Large subtrees are built on several cores; the result
// does not depend on how many. No bounds may be empty or have a coordinate beyond kMaxCoordinateM. When the work has to
// end, the tree is not to be used.
TriangleTree build_tree(std::span<TreePart> parts, uint32_t first_index, WorkLimit::Part& work);

}  // namespace sightline
