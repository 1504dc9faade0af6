// Triangle geometry: immutable once made, named by its content, shared by every session of the process.
//
// Triangles stand in clusters of at most kMaxClusterTriangles, each a contiguous range of `indices`, under a
// binary bounding-volume hierarchy. The EGL sampler culls with it, the clearance query of `move` searches it.
// See-through triangles (material opacity below kOccludingOpacity) have a tree of their own: they collide but
// do not occlude.
#pragma once

#include <array>
#include <cstdint>
#include <glm/glm.hpp>
#include <limits>
#include <memory>
#include <mutex>
#include <span>
#include <unordered_map>
#include <vector>

#include "server/base/error.h"
#include "server/base/hash.h"

namespace sightline {

// Opacity from here up occludes (design 4; Roblox's camera uses the same figure).
inline constexpr float kOccludingOpacity = 0.75f;
inline constexpr uint32_t kMaxClusterTriangles = 64;
// No leaf lies deeper below its root: a traversal's stack may have this fixed size.
inline constexpr int kMaxTreeDepth = 64;
// Largest magnitude of any coordinate of a mesh, and of any instance's position: beyond it float bounds
// overflow.
inline constexpr float kMaxCoordinateM = 1e9f;

struct Aabb {
  glm::vec3 min{std::numeric_limits<float>::infinity()};
  glm::vec3 max{-std::numeric_limits<float>::infinity()};

  void grow(const glm::vec3& p) { min = glm::min(min, p), max = glm::max(max, p); }
  bool empty() const { return !(min.x <= max.x); }
  glm::vec3 center() const { return 0.5f * (min + max); }
  glm::vec3 half_extent() const { return 0.5f * (max - min); }
};

// A node covers the index range [first_index, first_index + index_count). The left child of an inner node is
// the next node in the array, the right child is `right`; a leaf has right == 0 and is one cluster.
struct TreeNode {
  Aabb bounds;
  uint32_t first_index = 0;
  uint32_t index_count = 0;
  uint32_t right = 0;
  bool is_leaf() const { return right == 0; }
};

// Depth-first order, root first; empty when there are no triangles.
using TriangleTree = std::vector<TreeNode>;

// What a geometry is made from. `indices` are triples into `positions`. Triangles from
// `see_through_first_index` (a multiple of 3, or beyond the end) on are see-through; by default none is.
struct MeshData {
  std::vector<glm::vec3> positions;  // metres, in the mesh's own frame
  std::vector<uint32_t> indices;
  uint32_t see_through_first_index = UINT32_MAX;
};

// What a geometry holds, by what it is for.
struct GeometryBytes {
  size_t source = 0;    // positions and indices
  size_t clusters = 0;  // both trees, and the rest of the object
  size_t total() const { return source + clusters; }
};

class Geometry {
 public:
  ContentHash hash;                  // of the MeshData as given
  std::vector<glm::vec3> positions;  // metres, mesh frame; welded (weld.h)
  std::vector<uint32_t> indices;     // in cluster order; occluding triangles first
  uint32_t occluding_index_count = 0;
  TriangleTree occluding;    // over [0, occluding_index_count)
  TriangleTree see_through;  // over [occluding_index_count, indices.size())
  Aabb bounds;               // of all triangles
  glm::vec3 center{0.0f};    // of the bounding sphere, mesh frame
  float radius_m = 0.0f;     // of the bounding sphere

  size_t triangle_count() const { return indices.size() / 3; }
  GeometryBytes bytes_by_part() const;
  size_t bytes() const { return bytes_by_part().total(); }
};

// The name of a mesh's content: equal for equal positions, indices and see-through split.
ContentHash hash_mesh(const MeshData& mesh);

// Builds clusters and trees (tree_builder.h), on every core when there is much to do. Triangles of zero area
// are dropped; equal positions become one (weld.h), unused ones are kept. A mesh without triangles gives empty
// trees and an empty `bounds`. Fails with kInvalidArgument (field "indices", "positions" or
// "see_through_first_index") on an index out of range, an index count that is not a multiple of 3, or a
// position that is not finite or beyond kMaxCoordinateM. Deterministic: equal input gives equal output.
Result<std::shared_ptr<const Geometry>> build_geometry(MeshData mesh);

// Keeps one copy of each geometry as long as somebody holds it. Thread-safe; building happens outside the
// lock. Need not outlive what it handed out.
class GeometryStore {
 public:
  // The geometry of this content: the living copy, or a new one. Fails as build_geometry does.
  Result<std::shared_ptr<const Geometry>> intern(MeshData mesh);
  // Bytes of all geometries alive now, each counted once.
  GeometryBytes live_bytes_by_part() const;
  size_t live_bytes() const { return live_bytes_by_part().total(); }
  size_t live_count() const;

 private:
  std::shared_ptr<const Geometry> find(const ContentHash& hash) const;
  void forget_dead();  // needs mutex_

  mutable std::mutex mutex_;
  std::unordered_map<ContentHash, std::weak_ptr<const Geometry>> by_hash_;  // guarded by mutex_
  size_t forget_at_size_ = 64;                                              // guarded by mutex_
};

}  // namespace sightline
