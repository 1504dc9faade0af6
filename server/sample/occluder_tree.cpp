#include "server/sample/occluder_tree.h"

#include <algorithm>
#include <cmath>

namespace sightline {
namespace {

constexpr uint32_t kMaxLeafOccluders = 4;

float rounded_down(double value) {
  return std::nextafter(static_cast<float>(value), -std::numeric_limits<float>::infinity());
}
float rounded_up(double value) {
  return std::nextafter(static_cast<float>(value), std::numeric_limits<float>::infinity());
}

void grow(Aabb& box, const glm::dvec3& center_m, double radius_m) {
  box.grow(
      {rounded_down(center_m.x - radius_m), rounded_down(center_m.y - radius_m), rounded_down(center_m.z - radius_m)});
  box.grow({rounded_up(center_m.x + radius_m), rounded_up(center_m.y + radius_m), rounded_up(center_m.z + radius_m)});
}

// A request looks at now, at `ahead_s`, or at a time between: the box holds them all. An instance that turns goes round
// its own origin.
void gather(const Instance& instance, uint32_t slot, double ahead_s, std::vector<Occluder>& into) {
  if (!instance.geometry || !instance.occludes() || instance.geometry->occluding_index_count == 0) return;
  Occluder occluder{.bounds = {}, .slot = slot, .layers = instance.attributes.layers};
  grow(occluder.bounds, instance.center_m, instance.radius_m);
  if (ahead_s > 0) grow(occluder.bounds, center_ahead_m(instance, ahead_s), instance.radius_m);
  if (ahead_s > 0 && turns(instance)) {
    const glm::dvec3 origin_m = instance.world_from_instance[3];
    const double reach_m = instance.radius_m + glm::distance(instance.center_m, origin_m);
    for (const double time_s : {0.0, ahead_s}) grow(occluder.bounds, origin_m + travel_m(instance, time_s), reach_m);
  }
  into.push_back(occluder);
}

int longest_axis(const glm::vec3& extent) {
  return extent.x >= extent.y && extent.x >= extent.z ? 0 : extent.y >= extent.z ? 1 : 2;
}

void build_range(OccluderTree& tree, uint32_t first, uint32_t count) {
  const size_t self = tree.nodes.size();
  TreeNode node{.bounds = {}, .first_index = first, .index_count = count};
  Aabb centers;
  const auto begin = tree.occluders.begin() + first;
  for (auto it = begin; it != begin + count; ++it) {
    node.bounds.grow(it->bounds.min), node.bounds.grow(it->bounds.max);
    centers.grow(it->bounds.center());
  }
  tree.nodes.push_back(node);
  if (count <= kMaxLeafOccluders) return;
  const int axis = longest_axis(centers.half_extent());
  const uint32_t half = count / 2;
  std::nth_element(begin, begin + half, begin + count, [axis](const Occluder& a, const Occluder& b) {
    const float ca = a.bounds.min[axis] + a.bounds.max[axis], cb = b.bounds.min[axis] + b.bounds.max[axis];
    return ca != cb ? ca < cb : a.slot < b.slot;
  });
  build_range(tree, first, half);
  tree.nodes[self].right = static_cast<uint32_t>(tree.nodes.size());
  build_range(tree, first + half, count - half);
}

}  // namespace

void build_occluder_tree(OccluderTree& tree) {
  tree.nodes.clear();
  if (!tree.occluders.empty()) build_range(tree, 0, static_cast<uint32_t>(tree.occluders.size()));
}

void OccluderTable::take_in(const SceneMirror& mirror, double ahead_s) {
  const bool fresh = !taken_in_ || identity_ != mirror.identity();
  if (!fresh && version_ == mirror.version() && ahead_s_ == ahead_s) return;
  const std::span<const Instance> instances = mirror.instances();
  if (fresh || static_version_ != mirror.static_version()) {
    fixed_.occluders.clear();
    for (uint32_t slot = 0; slot < instances.size(); ++slot)
      if (!instances[slot].moving) gather(instances[slot], slot, 0.0, fixed_.occluders);
    build_occluder_tree(fixed_);
  }
  moving_.occluders.clear();
  for (const uint32_t slot : mirror.moving_slots()) gather(instances[slot], slot, ahead_s, moving_.occluders);
  build_occluder_tree(moving_);
  taken_in_ = true;
  identity_ = mirror.identity();
  version_ = mirror.version();
  static_version_ = mirror.static_version();
  ahead_s_ = ahead_s;
}

}  // namespace sightline
