// What has to be drawn for some maps: parts of instances, transformed relative to each map's eye. Filled by SampleSearch, drawn by
// MapRenderer.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

#include "server/scene/mirror.h"

namespace sightline {

enum class Detail {
  kTriangles,  // single triangles that a sample may show, what is hidden for certain left out: about one a sample
  kClusters,   // every cluster that may cover a sample: quick to find, much to draw
};

// One instance in one map; the rows as in ClipRows.
struct InstanceDraw {
  glm::vec4 clip_x, clip_y, clip_w;
  float near_m = 0.0f;
  uint32_t map = 0;                    // of the list
  const Instance* instance = nullptr;  // of the mirror; valid until it changes
  uint32_t slot = 0;                   // of the mirror
};

// Triangles of one instance in one map: [first_index, first_index + index_count) of Geometry::indices.
struct DrawPart {
  uint32_t instance = 0;  // into DrawList::instances
  uint32_t first_index = 0, index_count = 0;
  uint32_t first_triangle = 0;  // those of all parts before this one
};

// Filled anew for each take; its memory is reused.
struct DrawList {
  std::vector<InstanceDraw> instances;
  std::vector<DrawPart> parts;            // map by map; in a map by slot, then by index: the first of equal depth shows
  std::vector<uint32_t> end_part_of_map;  // map i has the parts from end_part_of_map[i - 1], or 0, up to [i]
  uint32_t triangle_count = 0;

  uint32_t first_part(size_t map) const { return map == 0 ? 0 : end_part_of_map[map - 1]; }
  void clear() {
    instances.clear(), parts.clear(), end_part_of_map.clear();
    triangle_count = 0;
  }
};

// The triangle with the number `triangle` of the list, counted through all parts.
struct DrawnTriangle {
  const InstanceDraw* instance;
  uint32_t first_index;
};
DrawnTriangle find_triangle(const DrawList& list, uint32_t triangle);

}  // namespace sightline
