// The moving instances of a mirror as the map taker meets them. Internal to sample/embree_*.
//
// No hierarchy stands above them: a tick only writes their centres, and a map finds those that its rays may meet by one
// pass over all bounding spheres. That costs about a nanosecond a sphere and map, where Embree takes one microsecond an
// instance and tick to commit a scene of them, once more for the time ahead. Instances that a request leaves out are left
// out here, so that Embree asks nobody about hits.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <memory>
#include <span>
#include <vector>

#include "server/sample/depth_map.h"
#include "server/sample/embree_parts.h"

namespace sightline {

// Holds all rays from one eye that lie within an angle below 90 degrees of the axis.
struct RayCone {
  glm::vec3 axis;  // unit
  float sine = 0, cosine = 1;

  // The cone about four rays, of any length, and all between them. They lie within 90 degrees of their sum.
  static RayCone around(std::span<const glm::vec3, 4> corners);
  // False only when no ray of the cone meets the ball.
  bool may_meet(const glm::vec3& center_from_eye_m, float radius_m) const;
};

// A moving instance that a map may show.
struct NearMover {
  uint32_t slot = 0;
  const BottomScene* bottom = nullptr;
  glm::vec3 center_from_eye_m{0.0f};
  float radius_m = 0.0f;   // rounded up by what single precision may err
  float nearest_m = 0.0f;  // no point of it is nearer to the eye
  // The eye, and what turns a direction, in the instance's frame.
  glm::vec3 eye_in_instance{0.0f};
  glm::mat3 instance_from_world{1.0f};
};

class EmbreeMovers {
 public:
  // After every change of the mirror; `ahead_s` as in EmbreeScene::take_in.
  void take_in(EmbreeDevice::Impl& device, const SceneMirror& mirror, double ahead_s);

  // Sets `near` to those that the request shows and a ray of the cone may meet, nearest first. Only for the `ahead_s` of take_in,
  // or none.
  void find(const SceneMirror& mirror, const MapRequest& request, const RayCone& cone, std::vector<NearMover>& near);

 private:
  struct Centers {
    std::vector<float> x, y, z;  // from the anchor, metres
    void place(const SceneMirror& mirror, std::span<const uint32_t> slots, const glm::dvec3& anchor_m, double ahead_s);
  };

  void list(EmbreeDevice::Impl& device, const SceneMirror& mirror);
  void mark(const Centers& centers, const glm::vec3& eye_from_anchor_m, const RayCone& cone, float far_m, float margin_m);

  uint64_t identity_ = 0, version_ = 0, moving_version_ = 0;  // of the mirror, as last taken in; 0: never
  double ahead_s_ = 0.0;                                      // of ahead_
  glm::dvec3 anchor_m_{0.0};
  // Parallel, by slot ascending.
  std::vector<uint32_t> slots_;
  std::vector<std::shared_ptr<const BottomScene>> bottoms_;
  std::vector<float> radius_m_;
  Centers now_, ahead_;
  std::vector<int32_t> marks_;  // scratch: whether the cone may meet it
};

}  // namespace sightline
