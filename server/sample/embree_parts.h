// The data that the Embree device, scenes and maps share. Internal to sample/embree_*.
#pragma once

#include <atomic>
#include <cmath>
#include <glm/glm.hpp>
#include <memory>
#include <span>
#include <unordered_map>
#include <vector>

#include "server/base/mutex.h"
#include "server/sample/embree_query.h"
#include "server/sample/embree_scene.h"

namespace sightline {

template <typename Handle, void (*release)(Handle)>
struct EmbreeReleaser {
  using pointer = Handle;
  void operator()(Handle handle) const { release(handle); }
};
using DeviceHandle = std::unique_ptr<RTCDevice, EmbreeReleaser<RTCDevice, rtcReleaseDevice>>;
using SceneHandle = std::unique_ptr<RTCScene, EmbreeReleaser<RTCScene, rtcReleaseScene>>;
using GeometryHandle = std::unique_ptr<RTCGeometry, EmbreeReleaser<RTCGeometry, rtcReleaseGeometry>>;

// Embree asserts that rays stay below 1.8e18; no scene reaches a billionth of it. False for NaN.
inline bool is_traceable(const glm::dvec3& origin_m, const glm::vec3& direction) {
  const auto is_near = [](const glm::dvec3& v) {
    constexpr double kMost = 1e18;
    return std::abs(v.x) <= kMost && std::abs(v.y) <= kMost && std::abs(v.z) <= kMost;
  };
  return is_near(origin_m) && is_near(direction);
}

// A committed scene of one geometry's triangles. `vertices` and `indices` point into Embree's own buffers.
struct BottomScene {
  SceneHandle scene;
  const float* vertices = nullptr;
  const uint32_t* indices = nullptr;
};

// One instance of a top scene. It has no padding, because it is hashed and compared as bytes.
struct Placement {
  uint32_t slot = 0;
  uint32_t layers = 0;
  const BottomScene* bottom = nullptr;
  Affine world_from_instance = identity_affine();
};
static_assert(sizeof(Placement) == 2 * sizeof(uint32_t) + sizeof(void*) + sizeof(Affine));

// One committed scene of instances. The instance id that Embree reports indexes `entries`, which ascend by slot.
struct TopScene {
  struct Entry {
    uint32_t slot;
    std::shared_ptr<const BottomScene> bottom;
    glm::mat3 linear;
  };
  SceneHandle scene;  // null when there is no instance
  glm::dvec3 anchor_m{0.0};
  std::vector<Entry> entries;

  bool holds(uint32_t slot) const;
};

// A top scene of static instances. Immutable: sessions whose static instances are equal share it.
struct StaticTop {
  TopScene top;
  std::vector<Placement> placements;  // what it was made from, compared to find it again
};

// Number of an instance's indices that belong in a scene of this kind (EmbreeScene::Content); 0 if the instance does
// not.
size_t counted_indices(const Instance& instance, EmbreeScene::Content content);

// Passed to Embree as its context, with our members behind. Without `filter` nothing is rejected and Embree makes no
// calls.
struct FilterContext {
  QueryContext query;  // must stay first
  const TopScene* top = nullptr;
  const RayFilter* filter = nullptr;

  FilterContext() = default;
  FilterContext(const TopScene& top, const RayFilter& filter);
};

struct EmbreeDevice::Impl {
  Impl();

  // Finds or builds. Building happens outside the lock: when two threads build the same thing, the later result is
  // dropped.
  std::shared_ptr<const BottomScene> bottom_of(const std::shared_ptr<const Geometry>& geometry, size_t index_count);
  // The top scene of the mirror's static instances that belong in a scene of this kind.
  std::shared_ptr<const StaticTop> static_top_of(const SceneMirror& mirror, EmbreeScene::Content content);
  // The top scene of its moving instances of this kind, placed where their velocities take them in `ahead_s`.
  TopScene moving_top_of(const SceneMirror& mirror, EmbreeScene::Content content, double ahead_s);
  void forget_dead();

  // A geometry and how many of its indices belong: all of them, or the occluding ones. Both are one bottom scene when
  // nothing is see-through.
  struct BottomKey {
    const Geometry* geometry;
    size_t index_count;
    bool operator==(const BottomKey&) const = default;
  };
  struct BottomKeyHash {
    size_t operator()(const BottomKey& key) const { return std::hash<const void*>()(key.geometry) ^ key.index_count; }
  };
  struct Bottom {
    std::weak_ptr<const Geometry> geometry;
    std::shared_ptr<const BottomScene> scene;
  };

  std::atomic<ssize_t> bytes{0};  // kept by Embree's memory monitor; outlives the device
  DeviceHandle device;
  Mutex mutex;
  std::unordered_map<BottomKey, Bottom, BottomKeyHash> bottoms GUARDED(mutex);
  // By hash of the placements.
  std::unordered_multimap<uint64_t, std::weak_ptr<const StaticTop>> statics GUARDED(mutex);

 private:
  std::shared_ptr<const BottomScene> find(const BottomKey& key) NEEDS(mutex);
  std::shared_ptr<const StaticTop> find(uint64_t hash, std::span<const Placement> placements) NEEDS(mutex);
};

}  // namespace sightline
