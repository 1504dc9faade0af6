#include "server/sample/draw_list.h"

#include <algorithm>

namespace sightline {
namespace {

// clip_from_view with the window shifted so that the centre of pixel (x, y) shows the jittered point of texel (x, y).
struct ClipMap {
  glm::dvec3 view_x, view_y, view_z;  // rows of view_from_world
  double scale_x, skew_x, scale_y, skew_y;
};

ClipMap clip_map(const MapView& view) {
  const double width = view.right - view.left, height = view.top - view.bottom;
  const double shift_x = (view.jitter.x - 0.5) * width / view.width,
               shift_y = (view.jitter.y - 0.5) * height / view.height;
  return {view.world_from_view[0],
          view.world_from_view[1],
          view.world_from_view[2],
          2.0 / width,
          (view.left + view.right + 2.0 * shift_x) / width,
          2.0 / height,
          (view.bottom + view.top + 2.0 * shift_y) / height};
}

// A row vector over instance coordinates: dot(direction, world position - eye).
glm::dvec4 row_over_instance(const glm::dvec3& direction, const Affine& world_from_instance,
                             const glm::dvec3& from_eye) {
  return {glm::dot(direction, world_from_instance[0]), glm::dot(direction, world_from_instance[1]),
          glm::dot(direction, world_from_instance[2]), glm::dot(direction, from_eye)};
}

struct ClipRows {
  glm::dvec4 x, y, w;  // of clip_from_instance
};

ClipRows clip_rows(const ClipMap& clip, const MapView& view, const Affine& world_from_instance) {
  const glm::dvec3 from_eye = world_from_instance[3] - view.eye_m;
  const glm::dvec4 x = row_over_instance(clip.view_x, world_from_instance, from_eye),
                   y = row_over_instance(clip.view_y, world_from_instance, from_eye),
                   z = row_over_instance(clip.view_z, world_from_instance, from_eye);
  return {clip.scale_x * x + clip.skew_x * z, clip.scale_y * y + clip.skew_y * z, -z};
}

}  // namespace

void OccluderTable::gather(const Instance& instance, uint32_t slot, std::vector<Occluder>& into) {
  if (!instance.geometry || !instance.occludes() || instance.geometry->occluding_index_count == 0) return;
  into.push_back({instance.center_m, instance.radius_m, slot, instance.attributes.layers});
}

void OccluderTable::take_in(const SceneMirror& mirror) {
  const bool fresh = !taken_in_ || identity_ != mirror.identity();
  if (!fresh && version_ == mirror.version()) return;
  const std::span<const Instance> instances = mirror.instances();
  if (fresh || static_version_ != mirror.static_version()) {
    fixed_.clear();
    for (uint32_t slot = 0; slot < instances.size(); ++slot)
      if (!instances[slot].moving) gather(instances[slot], slot, fixed_);
  }
  moving_.clear();
  for (const uint32_t slot : mirror.moving_slots()) gather(instances[slot], slot, moving_);
  taken_in_ = true;
  identity_ = mirror.identity();
  version_ = mirror.version();
  static_version_ = mirror.static_version();
}

void OccluderTable::append_map(const SceneMirror& mirror, const MapRequest& request, DrawList& list) {
  const uint32_t first = static_cast<uint32_t>(list.clusters.size());
  const Frustum frustum = sample_frustum(request.view);
  append_visible(mirror, request, frustum, fixed_, list);
  append_visible(mirror, request, frustum, moving_, list);
  // Equal depths keep the order of slots and trees, so that a replay draws in the same order.
  std::stable_sort(list.clusters.begin() + first, list.clusters.end(), [](const ClusterDraw& a, const ClusterDraw& b) {
    return a.cluster.near_depth_m < b.cluster.near_depth_m;
  });
  list.maps.push_back({first, static_cast<uint32_t>(list.clusters.size())});
}

void OccluderTable::append_visible(const SceneMirror& mirror, const MapRequest& request, const Frustum& frustum,
                                   std::span<const Occluder> occluders, DrawList& list) {
  const ClipMap clip = clip_map(request.view);
  const auto& ignored = request.ignored_slots;
  for (const Occluder& occluder : occluders) {
    if ((occluder.layers & request.layer_mask) == 0) continue;
    if (std::binary_search(ignored.begin(), ignored.end(), occluder.slot)) continue;
    const Instance& instance = mirror.instances()[occluder.slot];
    const glm::dvec3 center = occluder.center_m + travel_m(instance, request.ahead_s);
    if (sphere_is_outside(frustum, center, occluder.radius_m)) continue;
    const ClipRows rows = clip_rows(clip, request.view, world_from_instance_ahead(instance, request.ahead_s));
    visible_.clear();
    const SampleGrid grid = sample_grid(rows.x, rows.y, rows.w, request.view);
    append_visible_clusters(instance.geometry->occluding, grid, visible_);
    if (visible_.empty()) continue;
    const uint32_t index = static_cast<uint32_t>(list.instances.size());
    list.instances.push_back({glm::vec4(rows.x), glm::vec4(rows.y), glm::vec4(rows.w),
                              static_cast<float>(request.view.near_m), occluder.slot, &instance, grid});
    for (const VisibleCluster& cluster : visible_) list.clusters.push_back({cluster, index});
  }
}

}  // namespace sightline
