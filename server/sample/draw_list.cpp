#include "server/sample/draw_list.h"

#include <algorithm>

namespace sightline {
namespace {

// About what one more draw costs in llvmpipe, in triangles (tests/bench/sample_bench).
constexpr uint32_t kBridgeIndices = 3 * 64;

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

void set_clip_rows(const ClipMap& clip, const MapView& view, const Instance& instance, InstanceDraw& draw) {
  const Affine& to_world = instance.world_from_instance;
  const glm::dvec3 from_eye = to_world[3] - view.eye_m;
  const glm::dvec4 x = row_over_instance(clip.view_x, to_world, from_eye),
                   y = row_over_instance(clip.view_y, to_world, from_eye),
                   z = row_over_instance(clip.view_z, to_world, from_eye);
  draw.clip_x = glm::vec4(clip.scale_x * x + clip.skew_x * z);
  draw.clip_y = glm::vec4(clip.scale_y * y + clip.skew_y * z);
  draw.clip_w = glm::vec4(-z);
  draw.near_m = static_cast<float>(view.near_m);
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

void OccluderTable::append_map(const SceneMirror& mirror, const MapRequest& request, DrawList& list) const {
  MapDraw map{.first_instance = static_cast<uint32_t>(list.instances.size())};
  const Frustum frustum = sample_frustum(request.view);
  append_visible(mirror, request, frustum, fixed_, list);
  append_visible(mirror, request, frustum, moving_, list);
  map.instance_count = static_cast<uint32_t>(list.instances.size()) - map.first_instance;
  list.maps.push_back(map);
}

void OccluderTable::append_visible(const SceneMirror& mirror, const MapRequest& request, const Frustum& frustum,
                                   std::span<const Occluder> occluders, DrawList& list) const {
  const ClipMap clip = clip_map(request.view);
  const auto& ignored = request.ignored_slots;
  for (const Occluder& occluder : occluders) {
    if ((occluder.layers & request.layer_mask) == 0) continue;
    if (sphere_is_outside(frustum, occluder.center_m, occluder.radius_m)) continue;
    if (std::binary_search(ignored.begin(), ignored.end(), occluder.slot)) continue;
    const Instance& instance = mirror.instances()[occluder.slot];
    InstanceDraw draw;
    draw.first_range = static_cast<uint32_t>(list.ranges.size());
    append_visible_ranges(instance.geometry->occluding, to_local(frustum, instance.world_from_instance),
                          kBridgeIndices, list.ranges);
    draw.range_count = static_cast<uint32_t>(list.ranges.size()) - draw.first_range;
    if (draw.range_count == 0) continue;
    draw.slot = occluder.slot;
    draw.instance = &instance;
    set_clip_rows(clip, request.view, instance, draw);
    list.instances.push_back(draw);
  }
}

}  // namespace sightline
