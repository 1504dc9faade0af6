// An Embree scene of a mirror: the one place that talks to Embree. The Embree sampler takes depth maps with it; the
// truth renderer of the client and the tests use it as an independent reference.
//
// Two levels: a bottom scene per geometry, shared by all mirrors of a device; above them static and moving instances in
// two top scenes, so that a tick rebuilds only the moving one. Mirrors whose static instances are equal (slots, geometry,
// transforms, layers) share one static top scene; a mirror that changes one of them gets another.
//
// Embree computes in single precision. Each top scene is therefore anchored at the middle of its instances, and origins
// are given in double: what counts for rounding is the extent of the scene, not its distance from the world's origin.
// A hit distance errs by about 1e-7 of the distance plus 1e-7 of the larger of the distances anchor to eye and anchor
// to instance.
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

// Owns the RTCDevice, the bottom-level scenes and the static top scenes. Thread-safe. A
// bottom scene is kept while its Geometry lives (looked at whenever a top scene is added) or a scene uses it, a static top
// scene while an EmbreeScene or a map taker uses it. Nothing is built under a lock.
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
  // "3.13.5"
  static std::string version();

  // Kept alive by what was made with it.
  const std::shared_ptr<Impl>& impl() const { return impl_; }

 private:
  std::shared_ptr<Impl> impl_;
};

struct RayHit {
  float distance_m = std::numeric_limits<float>::infinity();  // in units of the direction's length
  uint32_t slot = UINT32_MAX;                                 // mirror slot; UINT32_MAX = nothing hit
  glm::vec3 normal{0.0f};                                     // geometric, world frame, not normalised
};

// What a ray may hit.
struct RayFilter {
  uint32_t layer_mask = 0xFFFFFFFF;
  std::span<const uint32_t> ignored_slots = {};  // ascending
  uint32_t only_slot = UINT32_MAX;          // when set, everything else is transparent
  bool ahead = false;                       // moving instances are where they will be (take_in's ahead_s)
};

// One mirror's scene. `take_in` after every change of the mirror; then any number of threads may trace at once.
class EmbreeScene {
 public:
  // Which instances and triangles: those that occlude, or those that collide (all triangles, see-through ones too).
  enum class Content { kOccluders, kColliders };

  EmbreeScene(EmbreeDevice& device, Content content);
  ~EmbreeScene();
  EmbreeScene(EmbreeScene&&) noexcept;
  EmbreeScene& operator=(EmbreeScene&&) noexcept;

  // With `ahead_s` > 0 moving instances are also placed where their velocities take them in that time, for rays that ask
  // for it.
  void take_in(const SceneMirror& mirror, double ahead_s = 0.0);

  // First hit in (near, far], distances in multiples of |direction|. Both sides of a triangle count.
  // `far` may be infinity. A ray that is not finite, or beyond 1e18, hits nothing.
  RayHit trace(const glm::dvec3& origin_m, const glm::vec3& direction, float near, float far,
               const RayFilter& filter = {}) const;
  // Distance in metres to the nearest surface, or `reach_m` when none is nearer (by rtcPointQuery).
  float nearest_surface_m(const glm::dvec3& point_m, float reach_m, std::span<const uint32_t> ignored_slots = {}) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace sightline
