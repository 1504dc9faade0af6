// Embree's device, shared with the sampler, and single rays through a mirror. The sampler takes its maps without
// EmbreeScene (embree_maps.h); the client's truth renderer, its judge and the tests use EmbreeScene as an independent
// reference.
//
// Scenes have two levels. Each geometry has a bottom scene, shared by all mirrors of a device. Above are two top
// scenes, one of static and one of moving instances, so that a tick rebuilds only the second. Mirrors whose static
// instances are equal (slots, geometry, transforms, layers) share one static top scene; a mirror that changes an
// instance gets another one.
//
// Embree computes in single precision. So each top scene is anchored at the middle of its instances, and origins are
// given in double. Rounding then depends on the extent of the scene, not on its distance from the world's origin. A hit
// distance errs by about 1e-7 of the distance plus 1e-7 of the distance from the anchor to the eye or to the instance,
// whichever is larger.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/glm.hpp>
#include <limits>
#include <memory>
#include <span>
#include <string>

#include "server/scene/mirror.h"

namespace sightline {

// Owns the RTCDevice, the bottom scenes and the static top scenes. Thread-safe. A bottom scene is kept while its
// Geometry lives (checked whenever a top scene is added, and by forget_unused) or a scene uses it. A static top scene
// is kept while an EmbreeScene or a map taker uses it. Nothing is built under a lock.
class EmbreeDevice {
 public:
  struct Impl;  // server/sample/embree_parts.h

  EmbreeDevice();
  ~EmbreeDevice();
  EmbreeDevice(const EmbreeDevice&) = delete;
  EmbreeDevice& operator=(const EmbreeDevice&) = delete;
  // Bytes that Embree holds now, by its own memory monitor: copies of positions and indices, and the hierarchies of all
  // scenes. About 85 a triangle of large meshes.
  size_t geometry_bytes() const;
  // Releases the bottom scenes of geometries that have died.
  void forget_unused();
  // "3.13.5"
  static std::string version();

  // Everything made with the device keeps this alive.
  const std::shared_ptr<Impl>& impl() const { return impl_; }

 private:
  std::shared_ptr<Impl> impl_;
};

struct RayHit {
  float distance_m = std::numeric_limits<float>::infinity();  // in units of the direction's length
  uint32_t slot = UINT32_MAX;                                 // mirror slot; UINT32_MAX = nothing hit
  glm::vec3 normal{0.0f};                                     // geometric, world frame, not normalised
};

// Restricts the instances that a ray may hit.
struct RayFilter {
  uint32_t layer_mask = 0xFFFFFFFF;
  std::span<const uint32_t> ignored_slots = {};  // ascending
  uint32_t only_slot = UINT32_MAX;               // when set, everything else is transparent
  bool ahead = false;                            // place moving instances where they will be in take_in's ahead_s
};

// One mirror's scene. `take_in` after every change of the mirror; then any number of threads may trace at once.
class EmbreeScene {
 public:
  // Either the occluding triangles of instances that occlude, or all triangles of instances that collide.
  enum class Content { kOccluders, kColliders };

  EmbreeScene(EmbreeDevice& device, Content content);
  ~EmbreeScene();
  EmbreeScene(EmbreeScene&&) noexcept;
  EmbreeScene& operator=(EmbreeScene&&) noexcept;

  // With `ahead_s` > 0 moving instances are also placed where their velocities take them in that time, for rays with
  // RayFilter::ahead.
  void take_in(const SceneMirror& mirror, double ahead_s = 0.0);

  // First hit in (near, far], distances in multiples of |direction|. Both sides of a triangle count.
  // `far` may be infinity. A ray that is not finite, or beyond 1e18, hits nothing.
  RayHit trace(const glm::dvec3& origin_m, const glm::vec3& direction, float near, float far,
               const RayFilter& filter = {}) const;
  // True if `trace` would hit something. Faster, because any hit will do.
  bool is_blocked(const glm::dvec3& origin_m, const glm::vec3& direction, float near, float far,
                  const RayFilter& filter = {}) const;
  // Distance in metres to the nearest surface, or `reach_m` when none is nearer (by rtcPointQuery).
  float nearest_surface_m(const glm::dvec3& point_m, float reach_m, std::span<const uint32_t> ignored_slots = {}) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace sightline
