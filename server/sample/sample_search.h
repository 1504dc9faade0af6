// Finds the triangles that the sample points of a map may show, front to back. The nearest box of all trees is opened
// first. A box behind surfaces that are known to cover all its samples is never opened. The cost is proportional to
// what is seen and grows with the logarithm of the rest.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "server/sample/cull.h"
#include "server/sample/draw_list.h"
#include "server/sample/occluder_tree.h"
#include "server/sample/triangle_block.h"

namespace sightline {

// Reusable scratch. Single-threaded.
class SampleSearch {
 public:
  // Appends to `list` one more map: a superset of the triangles that its samples show, to within kSampleMarginTexels
  // and kHidingMargin, of those that are no deeper than request.far_m. `table` has taken in `mirror` as it is, up to
  // request.ahead_s.
  void append_map(const OccluderTable& table, const SceneMirror& mirror, const MapRequest& request, DrawList& list);

 private:
  // An instance that may show in the map.
  struct Candidate {
    BoxTest test;
    ClipRows rows;
    const Instance* instance;
    uint32_t slot;
    uint32_t drawn_as;  // into DrawList::instances; UINT32_MAX before it is drawn
  };
  // A node still to be opened.
  struct Waiting {
    Footprint where;
    uint32_t node;
    uint32_t owner;  // into candidates_, or kFixedTree or kMovingTree
  };
  // A triangle that a sample may show.
  struct Hit {
    uint32_t candidate, first_index;
    uint32_t sample;
    float nearest_m;
  };
  // A triangle to draw.
  struct Shown {
    uint32_t slot, candidate, first_index;
  };
  static constexpr uint32_t kFixedTree = UINT32_MAX, kMovingTree = UINT32_MAX - 1;
  void hide_beyond_far();
  static bool later(const Waiting& a, const Waiting& b);

  void push(const BoxTest& test, const TriangleTree& tree, uint32_t owner, uint32_t node);
  bool pop_nearest(Waiting& nearest);
  void open_scene_node(const OccluderTree& tree, const BoxTest& test, const Waiting& waiting);
  void consider(const Occluder& occluder, const BoxTest& test);
  void open_geometry_node(const Waiting& waiting);
  void test_cluster(uint32_t candidate, const TreeNode& cluster);
  void test_samples(uint32_t candidate, uint32_t first_index, int triangle);
  void hide_behind_neighbours();
  void collect_unhidden();
  void draw_shown(DrawList& list);

  // State of the map that is being searched.
  const SceneMirror* mirror_ = nullptr;
  const MapRequest* request_ = nullptr;
  ClipMap clip_{};
  std::vector<Candidate> candidates_;
  std::vector<Waiting> waiting_;  // a heap, the nearest first
  // often the nearest node of all, so it enters the heap only when another is nearer
  std::optional<Waiting> ready_;
  std::vector<float> hidden_from_m_;  // by sample
  std::vector<Hit> hits_;
  std::vector<Shown> shown_;
  TriangleBlock block_;
  std::vector<SampleCover> uncertain_;  // of the block
};

}  // namespace sightline
