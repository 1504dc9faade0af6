// From a mirror and map requests to what has to be drawn: culled, and transformed relative to the eye in double.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "server/sample/cull.h"
#include "server/sample/depth_map.h"
#include "server/scene/mirror.h"

namespace sightline {

// One instance in one map. Rows of clip_from_instance: clip = (dot(x, p), dot(y, p), near, dot(w, p)) for a position
// p = (xyz, 1) of its geometry. That is reversed z without a far plane: depth = near / w.
struct InstanceDraw {
  glm::vec4 clip_x, clip_y, clip_w;
  float near_m = 0.0f;
  uint32_t slot = 0;
  const Instance* instance = nullptr;  // of the mirror; valid until it changes
  SampleGrid grid{};
};

struct ClusterDraw {
  VisibleCluster cluster;
  uint32_t instance = 0;  // into DrawList::instances
};

// What may show in one map: clusters [first_cluster, end_cluster) of DrawList::clusters, nearest first.
struct MapDraw {
  uint32_t first_cluster = 0, end_cluster = 0;
};

// Filled anew for each take; its memory is reused.
struct DrawList {
  std::vector<MapDraw> maps;
  std::vector<InstanceDraw> instances;
  std::vector<ClusterDraw> clusters;
  void clear() { maps.clear(), instances.clear(), clusters.clear(); }
};

// The occluding instances of one mirror, kept small for the scan of every map. Static ones are gathered anew only when
// the mirror's static version changes. Single-threaded.
class OccluderTable {
 public:
  void take_in(const SceneMirror& mirror);

  // Appends what one map may show. `mirror` is the one last taken in, unchanged since.
  void append_map(const SceneMirror& mirror, const MapRequest& request, DrawList& list);

 private:
  struct Occluder {
    glm::dvec3 center_m;
    double radius_m;
    uint32_t slot;
    uint32_t layers;
  };
  static void gather(const Instance& instance, uint32_t slot, std::vector<Occluder>& into);
  void append_visible(const SceneMirror& mirror, const MapRequest& request, const Frustum& frustum,
                      std::span<const Occluder> occluders, DrawList& list);

  uint64_t identity_ = 0, version_ = 0, static_version_ = 0;
  bool taken_in_ = false;
  std::vector<Occluder> fixed_, moving_;
  std::vector<VisibleCluster> visible_;  // scratch
};

}  // namespace sightline
