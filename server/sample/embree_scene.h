// An Embree scene of a mirror: the one place that talks to Embree. The Embree sampler takes depth maps with it; the
// truth renderer of the client and the tests use it as an independent reference.
//
// Two levels: a bottom scene per geometry, shared by all mirrors of a device; a top scene per mirror, with static and
// moving instances kept in two top scenes so that a tick rebuilds only the moving one.
#pragma once

#include <cstdint>
#include <functional>
#include <glm/glm.hpp>
#include <memory>
#include <span>

#include "server/scene/mirror.h"

namespace sightline {

// Owns the RTCDevice and the bottom-level scenes (kept while their geometry lives). Thread-safe.
class EmbreeDevice {
 public:
  EmbreeDevice();
  ~EmbreeDevice();
  EmbreeDevice(const EmbreeDevice&) = delete;
  EmbreeDevice& operator=(const EmbreeDevice&) = delete;
  size_t geometry_bytes() const;

 private:
  friend class EmbreeScene;
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

struct RayHit {
  float distance_m = std::numeric_limits<float>::infinity();  // in units of the direction's length
  uint32_t slot = UINT32_MAX;                                 // mirror slot; UINT32_MAX = nothing hit
  glm::vec3 normal{0.0f};                                     // geometric, world frame, not normalised
};

// What a ray may hit.
struct RayFilter {
  uint32_t layer_mask = 0xFFFFFFFF;
  std::span<const uint32_t> ignored_slots;  // ascending
  uint32_t only_slot = UINT32_MAX;          // when set, everything else is transparent
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

  void take_in(const SceneMirror& mirror);

  // First hit in (near, far], distances in multiples of |direction|. Both sides of a triangle count.
  RayHit trace(const glm::vec3& origin_m, const glm::vec3& direction, float near, float far,
               const RayFilter& filter = {}) const;
  // Distance in metres to the nearest surface, or `reach_m` when none is nearer (by rtcPointQuery).
  float nearest_surface_m(const glm::vec3& point_m, float reach_m, std::span<const uint32_t> ignored_slots = {}) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace sightline
