// How a TriangleTree is built: top-down, by a binned surface-area heuristic (Wald, "On fast construction of SAH-based
// bounding volume hierarchies", 2007) with the cost counted in clusters, so that leaves are well filled.
//
// Why not meshoptimizer, which reads the packed files: its clusters let more through. Triangles in the clusters that a
// 7 x 7 map from the streets of the city draws, and the time to make the clusters beside this builder's, which includes
// its tree and the geometry's checks, hash and welding (tests/bench/cluster_bench):
//                    mesh by mesh     as one mesh
//   this builder      2,355   1.0      2,415   1.0
//   meshlets          3,204   6.6      3,566   3.5
// meshopt_spatialSortTriangles is faster (0.13 to 0.5), and lets about twice as many through as this builder.
// Meshlets follow the surface for the sake of shared vertices and grow round corners; a map asks for tight boxes.
#pragma once

#include <cstdint>
#include <span>

#include "server/scene/geometry.h"

namespace sightline {

// One triangle on its way into a tree.
struct TreePart {
  Aabb bounds;
  uint32_t triangle = 0;  // in the mesh as given
};

// Orders `parts` so that each cluster's stand together, and builds the tree over them; triangle k of that order will
// have the indices [first_index + 3 k, first_index + 3 k + 3). Large subtrees are built on several cores; the result
// does not depend on how many. No bounds may be empty or have a coordinate beyond kMaxCoordinateM.
TriangleTree build_tree(std::span<TreePart> parts, uint32_t first_index);

}  // namespace sightline
