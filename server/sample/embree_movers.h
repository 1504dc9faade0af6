// The moving instances of a mirror, for embree_maps. Internal to sample/embree_*.
//
// There is no hierarchy above them. A tick only writes their centres, and each map tests all bounding spheres for those
// that its rays may hit. That costs about one nanosecond for each sphere and map. To commit a scene of the instances,
// Embree would take one microsecond for each instance and tick, and again for the time ahead. Instances that a request
// ignores are left out here, so that Embree needs no filter.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <memory>
#include <span>
#include <vector>

#include "server/sample/depth_map.h"
#include "server/sample/embree_parts.h"

namespace sightline {

// A cone of rays from one eye, with a half angle below 90 degrees.
struct RayCone {
  glm::vec3 axis;  // unit
  float sine = 0, cosine = 1;

  // The cone around four rays of any length, which must lie within 90 degrees of their sum, and all rays between them.
  static RayCone around(std::span<const glm::vec3, 4> corners);
  // False only when no ray of the cone hits the ball.
  bool may_meet(const glm::vec3& center_from_eye_m, float radius_m) const;
};

// A moving instance that a map may show.
struct NearMover {
  uint32_t slot = 0;
  const BottomScene* bottom = nullptr;
  glm::vec3 center_from_eye_m{0.0f};
  float radius_m = 0.0f;   // rounded up by the greatest error of single precision
  float nearest_m = 0.0f;  // no point of it is nearer to the eye
  // The eye in the instance's frame, and the map of directions into it.
  glm::vec3 eye_in_instance{0.0f};
  glm::mat3 instance_from_world{1.0f};
};

class EmbreeMovers {
 public:
  // To be called after every change of the mirror.
  void take_in(EmbreeDevice::Impl& device, const SceneMirror& mirror);

  // Sets `near` to the instances that the request includes and a ray of the cone may hit, nearest first, where they are
  // at its ahead_s. The mirror is that of take_in. The first request for a time since then places all instances.
  void find(const SceneMirror& mirror, const MapRequest& request, const RayCone& cone, std::vector<NearMover>& near);

 private:
  struct Centers {
    double ahead_s = 0.0;
    std::vector<float> x, y, z;  // from the anchor, metres
    void place(const SceneMirror& mirror, std::span<const uint32_t> slots, const glm::dvec3& anchor_m);
  };

  void list(EmbreeDevice::Impl& device, const SceneMirror& mirror);
  const Centers& centers_in(const SceneMirror& mirror, double ahead_s);
  void mark(const Centers& centers, const glm::vec3& eye_from_anchor_m, const RayCone& cone, float far_m,
            float margin_m);

  uint64_t identity_ = 0, version_ = 0, moving_version_ = 0;  // of the mirror, as last taken in; 0: never
  glm::dvec3 anchor_m_{0.0};
  // Parallel, by slot ascending.
  std::vector<uint32_t> slots_;
  std::vector<std::shared_ptr<const BottomScene>> bottoms_;
  std::vector<float> radius_m_;
  std::vector<Centers> centers_;  // by time; the first placed_ ones belong to the mirror as it is
  size_t placed_ = 0;
  std::vector<int32_t> marks_;  // scratch: whether the cone may hit the instance
};

}  // namespace sightline
