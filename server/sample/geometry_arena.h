// Where geometry stands on the OpenGL device: pages of one vertex format, so that instances of different geometries are
// drawn by one call. A geometry is uploaded once for all sessions and freed when it dies.
//
// Triangles share no vertices: gl_VertexID / 3 then names the triangle, at no cost in the pipeline. gl_PrimitiveID
// would count from the start of each draw, and make llvmpipe assemble primitives one by one. Slices start at whole triangles.
#pragma once

#include <cstdint>
#include <memory>
#include <unordered_map>
#include <vector>

#include "server/base/error.h"
#include "server/gl/gl_object.h"
#include "server/scene/geometry.h"

namespace sightline {

// The occluding triangles of one geometry: vertices [first_vertex, first_vertex + vertex_count) of a page, vertex i
// being positions[indices[i]].
struct ArenaSlice {
  uint32_t page = 0;
  uint32_t first_vertex = 0;
  uint32_t vertex_count = 0;
};

// Hands out runs of [0, size) first-fit, and joins what comes back.
class RunAllocator {
 public:
  explicit RunAllocator(uint32_t size) : free_{{0, size}} {}
  // The first unit of a run, or UINT32_MAX.
  uint32_t take(uint32_t count);
  void give_back(uint32_t first, uint32_t count);
  bool all_free(uint32_t size) const { return free_.size() == 1 && free_[0].count == size; }

 private:
  struct Run {
    uint32_t first, count;
  };
  std::vector<Run> free_;  // ascending; no two touch
};

// Needs its context current in every call but bytes(). Not thread-safe.
class GeometryArena {
 public:
  static constexpr size_t kVertexBytes = 3 * sizeof(float);
  // A new page is as large as all before it together, within these; a larger geometry has a page of its own.
  static constexpr uint32_t kMinPageVertices = (1u << 20) / kVertexBytes;
  static constexpr uint32_t kMaxPageVertices = (64u << 20) / kVertexBytes;

  // Uploads the geometry unless it is here. kResourceExhausted (field "geometry") when the device has no room.
  Result<ArenaSlice> place(const std::shared_ptr<const Geometry>& geometry);
  // Frees what belongs to dead geometries; pages left empty go, but for one.
  void sweep();

  size_t page_count() const { return pages_.size(); }
  GLuint buffer(uint32_t page) const { return pages_[page].buffer.name(); }
  // Bytes of live geometries.
  size_t bytes() const;

 private:
  struct Page {
    GlBuffer buffer;  // none: this number is free
    uint32_t vertices;
    RunAllocator runs;
  };
  struct Entry {
    std::weak_ptr<const Geometry> geometry;
    ArenaSlice slice;
  };
  Result<ArenaSlice> allocate(uint32_t vertex_count);
  Result<uint32_t> add_page(uint32_t vertices);
  void upload(const Geometry& geometry, const ArenaSlice& slice);

  std::vector<Page> pages_;
  std::unordered_map<const Geometry*, Entry> entries_;
  std::vector<glm::vec3> expanded_;  // scratch
};

}  // namespace sightline
