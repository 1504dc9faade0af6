// The spatial extent of a target (paper section 4): a view-indexed table of points on a shape's surface,
// spread evenly over its picture as it is seen from one of many places around it. The share of a view's
// points with a free line of sight to a place estimates the visible share of the target's picture from there.
//
// A table is taken off-line, once a shape: from viewpoints spread evenly around the shape, image points where
// a ray hits it are un-projected to its surface. All triangles count, see-through ones too: they are part of
// the target. What the shape hides of itself from a viewpoint has no points there.
//
// The paper keeps the density in the image the same from every distance, so that a larger picture has more
// points. Here every view has the same number, because what is asked is a share of the picture: each point
// stands for an equal part of it, and the estimate is as good from far as from near.
//
// Everything is in the mesh frame, metres. An instance's scale, uneven or not, is the caller's: bring the
// viewer into the mesh frame by the inverse of world_from_instance, look up, and bring the points out by
// world_from_instance. Under uneven scale the distance is measured in the mesh frame; the density stays even
// for a distant viewer, because an affine map keeps even densities of a parallel projection even.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <future>
#include <glm/glm.hpp>
#include <limits>
#include <memory>
#include <mutex>
#include <span>
#include <unordered_map>
#include <vector>

#include "server/base/hash.h"
#include "server/base/random.h"
#include "server/scene/geometry.h"
#include "server/scene/ray.h"

namespace sightline {

// Directions are a Fibonacci lattice on the sphere: no direction is further than 15 degrees from one of them.
inline constexpr size_t kExtentDirections = 96;
// In bounding radii from the centre of the bounding sphere; infinity is parallel projection. A viewer takes
// the one nearest in 1 / distance, which is what perspective goes with.
inline constexpr std::array<float, 4> kExtentDistances = {1.5f, 3.0f, 8.0f,
                                                          std::numeric_limits<float>::infinity()};
inline constexpr size_t kExtentViews = kExtentDirections * kExtentDistances.size();
inline constexpr size_t kExtentPoints = 64;  // of one view

struct ExtentView {
  glm::dvec3 direction{0.0, 0.0, 1.0};  // unit, from the centre of the bounding sphere to the viewer
  double distance = 1.5;                // over 1, in bounding radii; infinity: parallel projection
};

// Fills `points` with surface points of the caster's geometry, in an order that is well spread: any
// consecutive run is. Each by itself is distributed uniformly over the picture from `view` (on a plane across
// its direction). When less than about 1 part in 100 of the picture's frame is covered there may be too few
// hits: those there are repeat, and without any the centre of the bounding sphere stands for all (also for a
// geometry without triangles).
//
// The first is drawn at random; the others follow it on the R2 sequence (Roberts, "The unreasonable
// effectiveness of quasirandom sequences", 2018) around a torus, those that miss left out. A translation of a
// torus keeps areas, and so does its first-return map on the part that is hit: a uniform start makes every
// later point uniform too.
void sample_extent(const RayCaster& caster, const ExtentView& view, CounterRandom& random,
                   std::span<glm::vec3> points);

// Immutable: any number of threads may read one.
class ExtentTable {
 public:
  // A pure function of the geometry's content and the seed. Takes about 10 ms for a capsule, 30 ms for 10,000
  // triangles, 1.7 s for a million: before a session's steps rather than in one.
  static std::shared_ptr<const ExtentTable> build(const Geometry& geometry, uint64_t seed = 0);

  // The points of the view nearest to a viewer here (mesh frame, finite): always kExtentPoints, of equal
  // weight. From inside the bounding sphere, the nearest viewpoint outside it in the same direction serves;
  // from its very centre, any direction. The span lives as long as the table.
  std::span<const glm::vec3> points(const glm::dvec3& viewer_mesh_m) const;

  // The same with the viewer moved at random, `unit` in [0, 1)^2, by as much as a view stands for: over many draws, the views around
  // it in the shares in which it lies between them. One view alone shows a body that is up to 15 degrees turned, so that of a body
  // half of which is hidden by a wall it may well say 39 %, for as long as nothing moves.
  std::span<const glm::vec3> points_blended(const glm::dvec3& viewer_mesh_m, const glm::dvec2& unit) const;

  // The same by number, 0 to kExtentViews - 1.
  size_t view_index(const glm::dvec3& viewer_mesh_m) const;
  std::span<const glm::vec3> points_of_view(size_t index) const;
  static ExtentView view(size_t index);

  size_t bytes() const { return sizeof(ExtentTable) + points_m_.size() * sizeof(points_m_[0]); }

 private:
  explicit ExtentTable(const Geometry& geometry);
  glm::dvec3 center_m_;
  double radius_m_;
  std::array<glm::dvec3, kExtentDirections> directions_;
  std::vector<glm::vec3> points_m_;  // kExtentPoints a view
};

// The points to use at one tick, in round robin: `count` consecutive ones (the paper takes 1), so that all
// have had their turn after ceil(points.size() / count) ticks. All of them when count is as large. `out` is
// overwritten.
void pick_points(std::span<const glm::vec3> points, uint64_t tick, size_t count, std::vector<glm::vec3>& out);

// The tables of a process, one a shape, shared by all sessions. Thread-safe. A table is kept while the
// geometry that it was last asked for lives (looked at whenever another is built) or somebody holds the
// table. Hold what you got instead of asking every tick.
class ExtentCache {
 public:
  // All tables are built with this seed.
  explicit ExtentCache(uint64_t seed = 0) : seed_(seed) {}

  // Builds on the first call for a content, outside the lock; who asks for the same content meanwhile waits
  // for it.
  std::shared_ptr<const ExtentTable> get(const std::shared_ptr<const Geometry>& geometry);

  // Whether `get` would answer at once.
  bool has(const Geometry& geometry) const;

  // Tables kept now, those of dead geometries that nobody has looked for yet included.
  size_t count() const;

 private:
  using FutureTable = std::shared_future<std::shared_ptr<const ExtentTable>>;
  struct Entry {
    std::weak_ptr<const Geometry> geometry;
    FutureTable table;
  };

  const uint64_t seed_;
  mutable std::mutex mutex_;
  std::unordered_map<ContentHash, Entry> by_hash_;  // guarded by mutex_
};

}  // namespace sightline
