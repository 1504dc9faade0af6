// The peers that a step is compared with: simpler ways to find what is visible. Over the scene of one mirror, each
// finds which candidates see which targets' aim points, or does the expensive part of that.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "server/base/error.h"
#include "server/sample/depth_map.h"
#include "server/scene/mirror.h"

namespace sightline::bench {

// A query for one target.
struct SeenFrom {
  glm::dvec3 aim_m{0.0};
  uint32_t slot = 0;  // of the target itself, which never blocks its own ray
};

// One ray for each candidate and target. Bit i of `seen[k]`: candidate k sees target i. `prepare` takes in what moved.
class RayPeer {
 public:
  virtual ~RayPeer() = default;
  virtual void prepare() = 0;
  virtual void look(std::span<const SeenFrom> targets, std::span<const glm::dvec3> candidates_m,
                    std::vector<uint32_t>& seen) = 0;
};

// Embree's rtcOccluded1. All static instances are one flat scene of triangles, built with high quality; movers are
// instances in another scene.
std::unique_ptr<RayPeer> make_embree_peer(const SceneMirror& mirror);

// Bullet's btCollisionWorld::rayTest. Every instance is a collision object with a triangle-mesh shape, as in a game's
// physics.
std::unique_ptr<RayPeer> make_bullet_peer(const SceneMirror& mirror);

// The paper's method: the whole scene is drawn into every map, and each map is read back by glReadPixels. Everything
// that stands still is one vertex buffer, drawn by one call.
class DrawAllPeer {
 public:
  virtual ~DrawAllPeer() = default;
  virtual void take(std::span<const MapRequest> requests, std::vector<std::vector<float>>& depths) = 0;
};
// On the EGL device that the sampler would choose. kUnavailable where there is none.
Result<std::unique_ptr<DrawAllPeer>> make_draw_all_peer(const SceneMirror& mirror);

}  // namespace sightline::bench
