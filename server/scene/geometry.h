// Triangle geometry: immutable, identified by a hash of its data, shared by all sessions of the process.
//
// Triangles are grouped in clusters of at most kMaxClusterTriangles. Each cluster is a contiguous range of `indices`
// and a leaf of a binary bounding-volume hierarchy, which the EGL sampler and the clearance query of `move` search.
// See-through triangles (material opacity below kOccludingOpacity) have a tree of their own: they collide but do not
// occlude.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <glm/glm.hpp>
#include <limits>
#include <map>
#include <memory>
#include <span>
#include <vector>

#include "server/base/error.h"
#include "server/base/hash.h"
#include "server/base/mutex.h"
#include "server/base/work_limit.h"

namespace sightline {

// Surfaces of this opacity or more occlude. Roblox's camera uses the same figure.
inline constexpr float kOccludingOpacity = 0.75f;
inline constexpr uint32_t kMaxClusterTriangles = 64;
// The greatest depth of a leaf below its root, so that a traversal's stack can have this fixed size.
inline constexpr int kMaxTreeDepth = 64;
// The largest magnitude of any coordinate of a mesh or of an instance's position. Beyond it bounds in single precision
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

// A node covers the indices [first_index, first_index + index_count). The left child of an inner node is the next node
// in the array; the right child is at `right`. A leaf has right == 0 and is one cluster.
struct TreeNode {
  Aabb bounds;
  uint32_t first_index = 0;
  uint32_t index_count = 0;
  uint32_t right = 0;
  bool is_leaf() const { return right == 0; }
};

// Depth-first order, root first; empty when there are no triangles.
using TriangleTree = std::vector<TreeNode>;

// The input of build_geometry. `indices` are triples into `positions`. Triangles from `see_through_first_index` on (a
// multiple of 3, or beyond the end) are see-through; by default none is.
struct MeshData {
  std::vector<glm::vec3> positions;  // metres, in the mesh's own frame
  std::vector<uint32_t> indices;
  uint32_t see_through_first_index = UINT32_MAX;
};

// The memory of a geometry by purpose, in bytes.
struct GeometryBytes {
  size_t source = 0;    // positions and indices
  size_t clusters = 0;  // both trees and the object itself
  size_t total() const { return source + clusters; }
};

// A SHA-256.
using GeometryKey = std::array<unsigned char, 32>;

class Geometry {
 public:
  ContentHash hash;                  // of the MeshData as given
  GeometryKey key{};                 // the same, but it cannot be forged; identifies what clients share
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

// Identifies a mesh: equal for equal positions, indices and see_through_first_index.
ContentHash hash_mesh(const MeshData& mesh);

// Builds clusters and trees (tree_builder.h), for large meshes on every core. Drops triangles of zero area and merges
// equal positions (weld.h); unused positions are kept. A mesh without triangles gives empty trees and empty `bounds`.
// Fails with kInvalidArgument (field "indices", "positions" or "see_through_first_index"). The causes are an index out
// of range, an index count that is not a multiple of 3, or a position that is not finite or beyond kMaxCoordinateM.
// Deterministic: equal input gives equal output.
Result<std::shared_ptr<const Geometry>> build_geometry(MeshData mesh);

// Keeps one copy of each geometry while it is in use. Thread-safe; building happens outside the lock. The store may be
// destroyed before the geometries that it returned.
//
// Sessions of different clients share geometries, so a copy is found by its key. By a hash that can be forged, one
// client could put its geometry in the place of another's.
class GeometryStore {
 public:
  // The store holds at most `max_bytes`, by an estimate while a geometry is built; 0: no limit.
  explicit GeometryStore(size_t max_bytes = 0) : max_bytes_(max_bytes) {}
  // The geometry of this mesh: the existing copy, or a new one. Fails as build_geometry does, and with
  // kResourceExhausted when there is no room for a new one. Nothing is built then. Fails with work->error() when `work`
  // ends; null: nothing ends it.
  Result<std::shared_ptr<const Geometry>> intern(MeshData mesh, WorkLimit* work = nullptr);
  // Bytes of all geometries in use, each counted once.
  GeometryBytes live_bytes_by_part() const;
  size_t live_bytes() const { return live_bytes_by_part().total(); }
  size_t live_count() const;
  // What counts against `max_bytes` now.
  size_t reserved_bytes() const { return *bytes_; }

 private:
  std::shared_ptr<const Geometry> find(const GeometryKey& key) const;
  void forget_dead() NEEDS(mutex_);
  bool reserve(size_t bytes);

  const size_t max_bytes_;
  // The bytes of geometries in use, and the estimates for those that are being built. Geometries can outlive the store.
  const std::shared_ptr<std::atomic<size_t>> bytes_ = std::make_shared<std::atomic<size_t>>(0);

  mutable Mutex mutex_;
  std::map<GeometryKey, std::weak_ptr<const Geometry>> by_key_ GUARDED(mutex_);
  size_t forget_at_size_ GUARDED(mutex_) = 64;
};

}  // namespace sightline
