// Trees of boxes over the occluding instances of a mirror, so that the cost of finding those in a map's window grows
// with the logarithm of their number.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/scene/mirror.h"

namespace sightline {

struct Occluder {
  Aabb bounds;  // world, rounded outwards
  uint32_t slot;
  uint32_t layers;
};

// A leaf covers occluders [first_index, first_index + index_count).
struct OccluderTree {
  TriangleTree nodes;  // in the order of a TriangleTree; empty without occluders
  std::vector<Occluder> occluders;
};

// Sorts tree.occluders and builds tree.nodes over them, splitting at medians. Allocates only while `tree` grows.
void build_occluder_tree(OccluderTree& tree);

// One tree for static and one for moving instances, so that a tick rebuilds only the second. Not thread-safe.
class OccluderTable {
 public:
  // Updates both for requests up to `ahead_s`. Does nothing when neither the mirror nor `ahead_s` has changed.
  void take_in(const SceneMirror& mirror, double ahead_s);

  const OccluderTree& fixed() const { return fixed_; }
  const OccluderTree& moving() const { return moving_; }

 private:
  uint64_t identity_ = 0, version_ = 0, static_version_ = 0;
  double ahead_s_ = 0.0;
  bool taken_in_ = false;
  OccluderTree fixed_, moving_;
};

}  // namespace sightline
