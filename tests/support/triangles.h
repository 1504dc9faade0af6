// The triangles of a geometry as a set, for comparisons that ignore the order of triangles and vertices but not the
// winding.
#pragma once

#include <algorithm>
#include <array>
#include <vector>

#include "server/scene/geometry.h"

namespace sightline {

using Triangle = std::array<std::array<float, 3>, 3>;

// Sorted, each triangle rotated to start at its least corner.
inline std::vector<Triangle> triangles_of(const std::vector<glm::vec3>& positions,
                                          const std::vector<uint32_t>& indices) {
  std::vector<Triangle> all;
  for (size_t i = 0; i + 2 < indices.size(); i += 3) {
    Triangle t;
    for (size_t k = 0; k < 3; ++k) {
      const glm::vec3 p = positions[indices[i + k]];
      t[k] = {p.x, p.y, p.z};
    }
    std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
    all.push_back(t);
  }
  std::sort(all.begin(), all.end());
  return all;
}

inline std::vector<Triangle> triangles_of(const Geometry& geometry) {
  return triangles_of(geometry.positions, geometry.indices);
}
inline std::vector<Triangle> triangles_of(const MeshData& mesh) {
  return triangles_of(mesh.positions, mesh.indices);
}

}  // namespace sightline
