// The spatial extent of a target (paper section 4): a table of points on a shape's surface, indexed by view. The points
// of a view are spread evenly over the shape's image from there. The share of them with a free line of sight to a
// viewer estimates which share of the target's image the viewer sees.
//
// A table is built once for each shape: for viewpoints spread evenly around it, image points whose rays hit the shape
// are projected back to its surface. All triangles belong to the target, including see-through ones. Parts that the
// shape itself hides from a viewpoint have no points in that view.
//
// The paper keeps the density in the image constant over distance, so that a larger image has more points. Here every
// view has the same number, because the estimate is a share of the image. Each point represents an equal part, so the
// estimate is equally good at every distance.
//
// Everything is in the mesh frame, in metres. The caller handles the instance's transform: it takes the viewer into the
// mesh frame with the inverse of world_from_instance, and the points out with world_from_instance. Under uneven scale,
// distances are measured in the mesh frame. The density stays even for a distant viewer, because an affine map
// preserves even densities of a parallel projection.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <future>
#include <glm/glm.hpp>
#include <limits>
#include <map>
#include <memory>
#include <span>
#include <vector>

#include "server/base/hash.h"
#include "server/base/mutex.h"
#include "server/base/random.h"
#include "server/base/work_limit.h"
#include "server/scene/geometry.h"
#include "server/scene/ray.h"

namespace sightline {

// Directions form a Fibonacci lattice on the sphere: every direction is within 15 degrees of one of them.
inline constexpr size_t kExtentDirections = 96;
// Distances from the centre of the bounding sphere, in bounding radii; infinity is parallel projection. A viewer takes
// the nearest in 1 / distance, to which perspective is proportional.
inline constexpr std::array<float, 4> kExtentDistances = {1.5f, 3.0f, 8.0f, std::numeric_limits<float>::infinity()};
inline constexpr size_t kExtentViews = kExtentDirections * kExtentDistances.size();
inline constexpr size_t kExtentPoints = 64;  // of one view

struct ExtentView {
  glm::dvec3 direction{0.0, 0.0, 1.0};  // unit, from the centre of the bounding sphere to the viewer
  double distance = 1.5;                // over 1, in bounding radii; infinity: parallel projection
};

// Fills `points` with surface points of the caster's geometry. Any consecutive run of them is well spread, and each
// point by itself is distributed uniformly over the image from `view` (on a plane across its direction). When the shape
// covers less than about 1 % of the image there may be too few hits: then points repeat. Without any hit, and for a
// geometry without triangles, all points are the centre of the bounding sphere.
//
// The first point is random; the others follow it on the R2 sequence (Roberts, "The unreasonable effectiveness of
// quasirandom sequences", 2018) around a torus, without those that miss. A translation of a torus preserves areas, and
// so does its first-return map on the part that is hit: a uniform start makes every later point uniform too.
//
// Returns the area of the image, estimated by the share of the rays that hit, in m^2 at the distance of the sphere's
// centre; 0 without a hit. With 64 points it errs by a few percent. When the work has to end, the points and the area
// mean nothing.
double sample_extent(const RayCaster& caster, const ExtentView& view, CounterRandom& random,
                     std::span<glm::vec3> points, WorkLimit::Part& work);

// Immutable: any number of threads may read one.
class ExtentTable {
 public:
  // A pure function of the geometry and the seed. Null when `work` ends; a null one never does. Takes about 10 ms for a
  // capsule, 30 ms for 10,000 triangles and 1.7 s for a million, so build it before a session's first step.
  static std::shared_ptr<const ExtentTable> build(const Geometry& geometry, uint64_t seed = 0,
                                                  WorkLimit* work = nullptr);

  // The points of the view nearest to the viewer (mesh frame, finite): always kExtentPoints, of equal weight. A viewer
  // inside the bounding sphere gets the nearest viewpoint in its direction; at the centre, in any direction. The span
  // lives as long as the table.
  std::span<const glm::vec3> points(const glm::dvec3& viewer_mesh_m) const;

  // The same, with the viewer displaced at random (`unit` in [0, 1)^2) by about the spacing of views. Over many draws,
  // neighbouring views are chosen in proportion to their nearness. Without the displacement the nearest view may be
  // turned by 15 degrees. It would then estimate 39 % for a target that a wall hides by half, for as long as nothing
  // moves.
  std::span<const glm::vec3> points_blended(const glm::dvec3& viewer_mesh_m, const glm::dvec2& unit) const;

  // Views by index, 0 to kExtentViews - 1.
  size_t view_index(const glm::dvec3& viewer_mesh_m) const;
  std::span<const glm::vec3> points_of_view(size_t index) const;
  // See sample_extent. Divided by the squared distance of the viewer it is about the solid angle that the shape fills.
  double area_of_view_m2(size_t index) const { return areas_m2_[index]; }
  static ExtentView view(size_t index);

  size_t bytes() const {
    return sizeof(ExtentTable) + points_m_.size() * sizeof(points_m_[0]) + areas_m2_.size() * sizeof(areas_m2_[0]);
  }

 private:
  explicit ExtentTable(const Geometry& geometry);
  glm::dvec3 center_m_;
  double radius_m_;
  std::array<glm::dvec3, kExtentDirections> directions_;
  std::vector<glm::vec3> points_m_;  // kExtentPoints a view
  std::vector<double> areas_m2_;     // by view
};

// The points of one tick, in round robin: `count` consecutive ones (the paper takes 1), so that every point is used
// once in ceil(points.size() / count) ticks; all points when there are no more than `count`. Overwrites `out`.
void pick_points(std::span<const glm::vec3> points, uint64_t tick, size_t count, std::vector<glm::vec3>& out);

// The tables of a process, one for each shape, shared by all sessions. Thread-safe. A table is kept while a caller
// holds it, or while the geometry for which it was last requested lives (checked whenever another table is built). Keep
// the pointer instead of calling `get` every tick.
class ExtentCache {
 public:
  // All tables are built with this seed.
  explicit ExtentCache(uint64_t seed = 0) : seed_(seed) {}

  // Builds the table on the first call for a geometry, outside the lock; other callers for an equal geometry wait for
  // it. Null when `work` ends; then one of those that wait begins again.
  std::shared_ptr<const ExtentTable> get(const std::shared_ptr<const Geometry>& geometry, WorkLimit* work = nullptr);

  // True when `get` would return at once.
  bool has(const Geometry& geometry) const;

  // Tables kept now, including those of dead geometries that have not been removed yet.
  size_t count() const;

 private:
  using FutureTable = std::shared_future<std::shared_ptr<const ExtentTable>>;
  struct Entry {
    std::weak_ptr<const Geometry> geometry;
    FutureTable table;
  };

  std::shared_ptr<const ExtentTable> build(const std::shared_ptr<const Geometry>& geometry,
                                           std::promise<std::shared_ptr<const ExtentTable>>& built, WorkLimit* work);

  const uint64_t seed_;
  mutable Mutex mutex_;
  std::map<GeometryKey, Entry> by_key_ GUARDED(mutex_);
};

}  // namespace sightline
