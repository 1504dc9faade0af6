#include "server/sample/sample_search.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace sightline {

void SampleSearch::append_map(const OccluderTable& table, const SceneMirror& mirror, const MapRequest& request,
                              DrawList& list) {
  mirror_ = &mirror, request_ = &request;
  clip_ = clip_map(request.view);
  candidates_.clear(), waiting_.clear(), hits_.clear(), shown_.clear();
  hide_beyond_far();
  const SampleGrid world = sample_grid(clip_rows(clip_, request.view, identity_affine()), request.view);
  const auto test_of = [&](const OccluderTree& tree) {
    return BoxTest(world, tree.nodes.empty() ? Aabb{glm::vec3(0.0f), glm::vec3(0.0f)} : tree.nodes[0].bounds);
  };
  const BoxTest fixed = test_of(table.fixed()), moving = test_of(table.moving());
  push(fixed, table.fixed().nodes, kFixedTree, 0);
  push(moving, table.moving().nodes, kMovingTree, 0);
  for (Waiting next{}; pop_nearest(next);) {
    if (is_hidden(next.where, hidden_from_m_.data(), request.view.width)) continue;
    if (next.owner == kFixedTree)
      open_scene_node(table.fixed(), fixed, next);
    else if (next.owner == kMovingTree)
      open_scene_node(table.moving(), moving, next);
    else
      open_geometry_node(next);
  }
  collect_unhidden();
  draw_shown(list);
}

void SampleSearch::hide_beyond_far() {
  const MapView& view = request_->view;
  hidden_from_m_.assign(static_cast<size_t>(view.width) * view.height,
                        static_cast<float>(request_->far_m * (1.0 + kHidingMargin)));
}

bool SampleSearch::later(const Waiting& a, const Waiting& b) {
  return a.where.near_depth_m > b.where.near_depth_m;
}

void SampleSearch::push(const BoxTest& test, const TriangleTree& tree, uint32_t owner, uint32_t node) {
  if (tree.empty()) return;
  Waiting waiting{.where = {}, .node = node, .owner = owner};
  if (!test.may_show(tree[node].bounds, waiting.where)) return;
  if (!test.may_show_unhidden(tree[node].bounds, waiting.where, hidden_from_m_.data())) return;
  if (!ready_) {
    ready_ = waiting;
    return;
  }
  if (later(*ready_, waiting)) std::swap(*ready_, waiting);
  waiting_.push_back(waiting);
  std::push_heap(waiting_.begin(), waiting_.end(), later);
}

bool SampleSearch::pop_nearest(Waiting& nearest) {
  if (ready_ && (waiting_.empty() || !later(*ready_, waiting_.front()))) {
    nearest = *ready_;
    ready_.reset();
    return true;
  }
  if (waiting_.empty()) return false;
  std::pop_heap(waiting_.begin(), waiting_.end(), later);
  nearest = waiting_.back();
  waiting_.pop_back();
  return true;
}

void SampleSearch::open_scene_node(const OccluderTree& tree, const BoxTest& test, const Waiting& waiting) {
  const TreeNode& node = tree.nodes[waiting.node];
  if (node.is_leaf()) {
    for (uint32_t i = node.first_index; i < node.first_index + node.index_count; ++i) consider(tree.occluders[i], test);
  } else {
    push(test, tree.nodes, waiting.owner, waiting.node + 1);
    push(test, tree.nodes, waiting.owner, node.right);
  }
}

void SampleSearch::consider(const Occluder& occluder, const BoxTest& test) {
  if ((occluder.layers & request_->layer_mask) == 0) return;
  const auto& ignored = request_->ignored_slots;
  if (std::binary_search(ignored.begin(), ignored.end(), occluder.slot)) return;
  Footprint where;
  if (!test.may_show(occluder.bounds, where)) return;
  if (!test.may_show_unhidden(occluder.bounds, where, hidden_from_m_.data())) return;
  const Instance& instance = mirror_->instances()[occluder.slot];
  const ClipRows rows = clip_rows(clip_, request_->view, world_from_instance_ahead(instance, request_->ahead_s));
  candidates_.push_back({BoxTest(sample_grid(rows, request_->view), instance.geometry->bounds), rows, &instance,
                         occluder.slot, UINT32_MAX});
  push(candidates_.back().test, instance.geometry->occluding, static_cast<uint32_t>(candidates_.size() - 1), 0);
}

void SampleSearch::open_geometry_node(const Waiting& waiting) {
  const Candidate& candidate = candidates_[waiting.owner];
  const TriangleTree& tree = candidate.instance->geometry->occluding;
  const TreeNode& node = tree[waiting.node];
  if (!node.is_leaf()) {
    push(candidate.test, tree, waiting.owner, waiting.node + 1);
    push(candidate.test, tree, waiting.owner, node.right);
  } else if (candidate.test.may_show_unhidden(node.bounds, waiting.where, hidden_from_m_.data())) {
    test_cluster(waiting.owner, node);
  }
}

void SampleSearch::test_cluster(uint32_t candidate, const TreeNode& cluster) {
  const BoxTest& test = candidates_[candidate].test;
  read_triangles(*candidates_[candidate].instance->geometry, cluster.first_index, cluster.index_count, block_);
  project_triangles(test.grid(), test.slack(), block_);
  uncertain_.clear();
  for (int i = 0; i < block_.count; ++i)
    if (block_.x0[i] <= block_.x1[i]) test_samples(candidate, cluster.first_index + 3 * static_cast<uint32_t>(i), i);
  hide_behind_neighbours();
}

void SampleSearch::test_samples(uint32_t candidate, uint32_t first_index, int triangle) {
  const BoxTest& test = candidates_[candidate].test;
  const float near_m = test.grid().near_m, least_m = block_.nearest_m[triangle] * (1.0f - kHidingMargin);
  const int width = test.grid().width;
  for (int y = block_.y0[triangle]; y <= block_.y1[triangle]; ++y)
    for (int x = block_.x0[triangle]; x <= block_.x1[triangle]; ++x) {
      float& hidden_from_m = hidden_from_m_[static_cast<size_t>(y * width + x)];
      if (hidden_from_m < least_m) continue;
      const Cover cover = cover_of(block_, triangle, x, y, test.slack(), near_m);
      const float nearest_m = cover.low_m * (1.0f - kHidingMargin);
      if (!cover.possible || hidden_from_m < nearest_m) continue;
      hits_.push_back({candidate, first_index, static_cast<uint32_t>(y * width + x), nearest_m});
      if (cover.certain)
        hidden_from_m = std::min(hidden_from_m, cover.high_m);
      else if (cover.turn != 0)
        uncertain_.push_back({static_cast<uint32_t>(y * width + x), triangle, cover});
    }
}

void SampleSearch::hide_behind_neighbours() {
  std::sort(uncertain_.begin(), uncertain_.end(), [](const SampleCover& a, const SampleCover& b) {
    return a.sample != b.sample ? a.sample < b.sample : a.triangle < b.triangle;
  });
  for (auto first = uncertain_.begin(); first != uncertain_.end();) {
    const auto end = std::find_if(first, uncertain_.end(),
                                  [&](const SampleCover& c) { return c.sample != first->sample; });
    float& hidden_from_m = hidden_from_m_[first->sample];
    if (end - first > 1) hidden_from_m = std::min(hidden_from_m, covered_together_from_m(block_, {first, end}));
    first = end;
  }
}

// Drops hits that were hidden after they were found.
void SampleSearch::collect_unhidden() {
  for (const Hit& hit : hits_) {
    if (hidden_from_m_[hit.sample] < hit.nearest_m) continue;
    if (!shown_.empty() && shown_.back().candidate == hit.candidate && shown_.back().first_index == hit.first_index)
      continue;
    shown_.push_back({candidates_[hit.candidate].slot, hit.candidate, hit.first_index});
  }
}

void SampleSearch::draw_shown(DrawList& list) {
  std::sort(shown_.begin(), shown_.end(), [](const Shown& a, const Shown& b) {
    return a.slot != b.slot ? a.slot < b.slot : a.first_index < b.first_index;
  });
  for (const Shown& shown : shown_) {
    Candidate& candidate = candidates_[shown.candidate];
    if (candidate.drawn_as == UINT32_MAX) {
      candidate.drawn_as = static_cast<uint32_t>(list.instances.size());
      list.instances.push_back({glm::vec4(candidate.rows.x), glm::vec4(candidate.rows.y), glm::vec4(candidate.rows.w),
                                static_cast<float>(request_->view.near_m), list.map_count, candidate.instance,
                                candidate.slot});
    }
    list.triangles.push_back({candidate.drawn_as, shown.first_index});
  }
  ++list.map_count;
}

}  // namespace sightline
