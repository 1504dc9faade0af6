// The triangles that have to be drawn for some maps. SampleSearch fills the list, MapRenderer draws it.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

#include "server/scene/mirror.h"

namespace sightline {

// One instance in one map; the rows are those of ClipRows, relative to the map's eye.
struct InstanceDraw {
  glm::vec4 clip_x, clip_y, clip_w;
  float near_m = 0.0f;
  uint32_t map = 0;                    // of the list
  const Instance* instance = nullptr;  // of the mirror; valid until the mirror changes
  uint32_t slot = 0;                   // of the mirror
};

struct TriangleDraw {
  uint32_t instance = 0;     // index into DrawList::instances
  uint32_t first_index = 0;  // index into Geometry::indices
};

// Cleared and filled for each submission; its memory is reused.
struct DrawList {
  std::vector<InstanceDraw> instances;
  std::vector<TriangleDraw> triangles;  // by map, then slot, then first_index: of two at equal depth the first shows
  uint32_t map_count = 0;

  void clear() {
    instances.clear(), triangles.clear();
    map_count = 0;
  }
};

}  // namespace sightline
