#include "server/sample/embree_scene.h"

#include <embree3/rtcore.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <mutex>
#include <unordered_map>
#include <utility>
#include <vector>

namespace sightline {
namespace {

template <typename Handle, void (*release)(Handle)>
struct Releaser {
  using pointer = Handle;
  void operator()(Handle handle) const { release(handle); }
};
using DeviceHandle = std::unique_ptr<RTCDevice, Releaser<RTCDevice, rtcReleaseDevice>>;
using SceneHandle = std::unique_ptr<RTCScene, Releaser<RTCScene, rtcReleaseScene>>;
using GeometryHandle = std::unique_ptr<RTCGeometry, Releaser<RTCGeometry, rtcReleaseGeometry>>;

constexpr size_t kHierarchyBytesPerTriangle = 80;

// A committed scene of one geometry's triangles. `vertices` and `indices` point into Embree's own buffers.
struct BottomScene {
  SceneHandle scene;
  const float* vertices = nullptr;
  const uint32_t* indices = nullptr;
  size_t bytes = 0;
};

std::shared_ptr<const BottomScene> build_bottom(RTCDevice device, const Geometry& geometry, size_t index_count) {
  auto bottom = std::make_shared<BottomScene>();
  const GeometryHandle mesh(rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE));
  // Embree reads 16 bytes from every vertex, so its own padded buffers are used instead of sharing ours.
  auto* vertices = static_cast<float*>(rtcSetNewGeometryBuffer(mesh.get(), RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                                               sizeof(glm::vec3), geometry.positions.size()));
  auto* indices = static_cast<uint32_t*>(rtcSetNewGeometryBuffer(mesh.get(), RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                                                 3 * sizeof(uint32_t), index_count / 3));
  std::copy_n(&geometry.positions[0].x, 3 * geometry.positions.size(), vertices);
  std::copy_n(geometry.indices.data(), index_count, indices);
  bottom->vertices = vertices;
  bottom->indices = indices;
  bottom->bytes = geometry.positions.size() * sizeof(glm::vec3) + index_count * sizeof(uint32_t) +
                  index_count / 3 * kHierarchyBytesPerTriangle;
  // Layers are a matter of the instance: here every bit is set.
  rtcSetGeometryMask(mesh.get(), 0xFFFFFFFF);
  rtcSetGeometryBuildQuality(mesh.get(), RTC_BUILD_QUALITY_HIGH);
  rtcCommitGeometry(mesh.get());

  bottom->scene.reset(rtcNewScene(device));
  rtcSetSceneFlags(bottom->scene.get(), static_cast<RTCSceneFlags>(RTC_SCENE_FLAG_ROBUST |
                                                                   RTC_SCENE_FLAG_CONTEXT_FILTER_FUNCTION));
  rtcSetSceneBuildQuality(bottom->scene.get(), RTC_BUILD_QUALITY_HIGH);
  rtcAttachGeometry(bottom->scene.get(), mesh.get());
  rtcCommitScene(bottom->scene.get());
  return bottom;
}

}  // namespace

struct EmbreeDevice::Impl {
  struct Entry {
    std::weak_ptr<const Geometry> geometry;
    std::shared_ptr<const BottomScene> bottom;
  };
  // A geometry and how many of its indices count: all of them, or the occluding ones. The two are one bottom scene
  // where nothing is see-through.
  struct Key {
    const Geometry* geometry;
    size_t index_count;
    bool operator==(const Key&) const = default;
  };
  struct KeyHash {
    size_t operator()(const Key& key) const { return std::hash<const void*>()(key.geometry) ^ key.index_count; }
  };

  DeviceHandle device{rtcNewDevice(nullptr)};
  mutable std::mutex mutex;
  std::unordered_map<Key, Entry, KeyHash> bottoms;  // guarded by mutex

  std::shared_ptr<const BottomScene> find(const Key& key) const {
    const std::lock_guard lock(mutex);
    const auto found = bottoms.find(key);
    // An address may be used again by another geometry after the first one died.
    if (found == bottoms.end() || found->second.geometry.expired()) return nullptr;
    return found->second.bottom;
  }

  // Builds outside the lock: when two threads meet over one geometry, the later result is dropped.
  std::shared_ptr<const BottomScene> bottom_of(const std::shared_ptr<const Geometry>& geometry, size_t index_count) {
    const Key key{geometry.get(), index_count};
    if (auto bottom = find(key)) return bottom;
    auto built = build_bottom(device.get(), *geometry, index_count);
    const std::lock_guard lock(mutex);
    std::erase_if(bottoms, [](const auto& item) { return item.second.geometry.expired(); });
    return bottoms.try_emplace(key, Entry{geometry, std::move(built)}).first->second.bottom;
  }
};

EmbreeDevice::EmbreeDevice() : impl_(std::make_unique<Impl>()) {
  assert(impl_->device);
  assert(rtcGetDeviceProperty(impl_->device.get(), RTC_DEVICE_PROPERTY_RAY_MASK_SUPPORTED));
  assert(rtcGetDeviceProperty(impl_->device.get(), RTC_DEVICE_PROPERTY_FILTER_FUNCTION_SUPPORTED));
}
EmbreeDevice::~EmbreeDevice() = default;

std::string EmbreeDevice::version() {
  return RTC_VERSION_STRING;
}

size_t EmbreeDevice::geometry_bytes() const {
  const std::lock_guard lock(impl_->mutex);
  size_t bytes = 0;
  for (const auto& [key, entry] : impl_->bottoms)
    if (!entry.geometry.expired()) bytes += entry.bottom->bytes;
  return bytes;
}

namespace {

using Content = EmbreeScene::Content;

size_t counted_indices(const Instance& instance, Content content) {
  if (!instance.geometry) return 0;
  if (content == Content::kOccluders) return instance.occludes() ? instance.geometry->occluding_index_count : 0;
  return instance.collides() ? instance.geometry->indices.size() : 0;
}

bool is_ignored(uint32_t slot, std::span<const uint32_t> ignored_slots) {
  return std::binary_search(ignored_slots.begin(), ignored_slots.end(), slot);
}

// One committed scene of instances. The instance id that Embree reports indexes `entries`.
struct TopScene {
  struct Entry {
    uint32_t slot;
    GeometryHandle handle;
    std::shared_ptr<const BottomScene> bottom;
    glm::mat3 linear;
  };
  SceneHandle scene;
  glm::dvec3 anchor_m{0.0};
  std::vector<Entry> entries;

  void set_transform(Entry& entry, const Instance& instance, double ahead_s) const {
    Affine from_instance = world_from_instance_ahead(instance, ahead_s);
    from_instance[3] -= anchor_m;
    const glm::mat4x3 columns(from_instance);
    entry.linear = glm::mat3(columns);
    rtcSetGeometryTransform(entry.handle.get(), 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, &columns[0].x);
    rtcCommitGeometry(entry.handle.get());
  }
};

// Passed to Embree as its own context with our tail.
struct FilterContext {
  RTCIntersectContext embree;  // must stay first
  const TopScene* top;
  const RayFilter* filter;
};

void reject_filtered(const RTCFilterFunctionNArguments* args) {
  const auto* context = reinterpret_cast<const FilterContext*>(args->context);
  const uint32_t slot = context->top->entries[args->context->instID[0]].slot;
  const RayFilter& filter = *context->filter;
  const bool other = filter.only_slot != UINT32_MAX && slot != filter.only_slot;
  if (other || is_ignored(slot, filter.ignored_slots)) args->valid[0] = 0;
}

// Transpose of the adjugate: maps normals as the inverse transpose does, up to the determinant, whose sign is kept.
glm::vec3 transform_normal(const glm::mat3& linear, const glm::vec3& normal) {
  const glm::mat3 cofactor(glm::cross(linear[1], linear[2]), glm::cross(linear[2], linear[0]),
                           glm::cross(linear[0], linear[1]));
  const glm::vec3 out = cofactor * normal;
  return glm::dot(linear[0], cofactor[0]) < 0 ? -out : out;
}

// Replaces `hit` when something nearer than it is hit.
void trace_top(const TopScene& top, const glm::dvec3& origin_m, const glm::vec3& direction, float near, float far,
               const RayFilter& filter, RayHit& hit) {
  if (top.entries.empty()) return;
  const glm::vec3 origin(origin_m - top.anchor_m);
  FilterContext context;
  rtcInitIntersectContext(&context.embree);
  context.top = &top;
  context.filter = &filter;
  if (!filter.ignored_slots.empty() || filter.only_slot != UINT32_MAX) context.embree.filter = reject_filtered;
  RTCRayHit query{};
  query.ray = {origin.x, origin.y, origin.z, near, direction.x, direction.y, direction.z, 0.0f,
               std::min(far, hit.distance_m), filter.layer_mask, 0, 0};
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  rtcIntersect1(top.scene.get(), &context.embree, &query);
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return;
  const TopScene::Entry& entry = top.entries[query.hit.instID[0]];
  hit.distance_m = query.ray.tfar;
  hit.slot = entry.slot;
  hit.normal = transform_normal(entry.linear, {query.hit.Ng_x, query.hit.Ng_y, query.hit.Ng_z});
}

// Ericson, Real-Time Collision Detection (2005), 5.1.5.
glm::vec3 closest_on_triangle(const glm::vec3& p, const glm::vec3& a, const glm::vec3& b, const glm::vec3& c) {
  const glm::vec3 ab = b - a, ac = c - a, ap = p - a, bp = p - b, cp = p - c;
  const float d1 = glm::dot(ab, ap), d2 = glm::dot(ac, ap), d3 = glm::dot(ab, bp), d4 = glm::dot(ac, bp),
              d5 = glm::dot(ab, cp), d6 = glm::dot(ac, cp);
  if (d1 <= 0 && d2 <= 0) return a;
  if (d3 >= 0 && d4 <= d3) return b;
  if (d6 >= 0 && d5 <= d6) return c;
  const float vc = d1 * d4 - d3 * d2, vb = d5 * d2 - d1 * d6, va = d3 * d6 - d5 * d4;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return a + ab * (d1 / (d1 - d3));
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return a + ac * (d2 / (d2 - d6));
  if (va <= 0 && d4 >= d3 && d5 >= d6) return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
  return a + (ab * vb + ac * vc) / (va + vb + vc);
}

struct NearestQuery {
  const TopScene* top;
  std::span<const uint32_t> ignored_slots;
};

// Works in world space (not in the instance's), so that any linear map is right.
bool shrink_to_triangle(RTCPointQueryFunctionArguments* args) {
  const auto* query = static_cast<const NearestQuery*>(args->userPtr);
  const TopScene::Entry& entry = query->top->entries[args->context->instID[0]];
  if (is_ignored(entry.slot, query->ignored_slots)) return false;
  const float* m = args->context->inst2world[0];
  std::array<glm::vec3, 3> corner;
  for (int k = 0; k < 3; ++k) {
    const float* v = entry.bottom->vertices + 3 * size_t{entry.bottom->indices[3 * size_t{args->primID} + k]};
    corner[k] = glm::vec3(m[0], m[1], m[2]) * v[0] + glm::vec3(m[4], m[5], m[6]) * v[1] +
                glm::vec3(m[8], m[9], m[10]) * v[2] + glm::vec3(m[12], m[13], m[14]);
  }
  const glm::vec3 point(args->query->x, args->query->y, args->query->z);
  const float distance = glm::distance(point, closest_on_triangle(point, corner[0], corner[1], corner[2]));
  if (!(distance < args->query->radius)) return false;
  args->query->radius = distance;
  return true;
}

float nearest_in_top(const TopScene& top, const glm::dvec3& point_m, float reach_m,
                     std::span<const uint32_t> ignored_slots) {
  if (top.entries.empty()) return reach_m;
  const glm::vec3 point(point_m - top.anchor_m);
  RTCPointQuery query{point.x, point.y, point.z, 0.0f, reach_m};
  RTCPointQueryContext context;
  rtcInitPointQueryContext(&context);
  NearestQuery nearest{&top, ignored_slots};
  rtcPointQuery(top.scene.get(), &query, &context, shrink_to_triangle, &nearest);
  return query.radius;
}

}  // namespace

struct EmbreeScene::Impl {
  EmbreeDevice::Impl& device;
  const Content content;
  uint64_t identity = 0;
  bool taken_in = false;
  uint64_t version = 0, static_version = 0, moving_version = 0;
  double ahead_s = 0.0;  // of `ahead`
  TopScene fixed, moving, ahead;  // `ahead`: the moving ones in ahead_s; empty while nobody asks

  // The middle of what the scene will hold, so that single precision serves the whole of it equally.
  static glm::dvec3 middle(std::span<const Instance> instances, std::span<const uint32_t> slots) {
    glm::dvec3 low(std::numeric_limits<double>::infinity()), high(-low);
    for (const uint32_t slot : slots) {
      low = glm::min(low, instances[slot].center_m);
      high = glm::max(high, instances[slot].center_m);
    }
    return 0.5 * (low + high);
  }

  void build(TopScene& top, std::span<const Instance> instances, std::span<const uint32_t> slots,
             RTCBuildQuality quality, double after_s = 0.0) {
    top = TopScene{};
    if (slots.empty()) return;
    RTCDevice rtc = device.device.get();
    top.anchor_m = middle(instances, slots);
    top.scene.reset(rtcNewScene(rtc));
    rtcSetSceneFlags(top.scene.get(), static_cast<RTCSceneFlags>(
                                          RTC_SCENE_FLAG_ROBUST | RTC_SCENE_FLAG_CONTEXT_FILTER_FUNCTION |
                                          (quality == RTC_BUILD_QUALITY_LOW ? RTC_SCENE_FLAG_DYNAMIC : 0)));
    rtcSetSceneBuildQuality(top.scene.get(), quality);
    top.entries.reserve(slots.size());
    for (const uint32_t slot : slots) attach(top, slot, instances[slot], after_s);
    rtcCommitScene(top.scene.get());
  }

  void attach(TopScene& top, uint32_t slot, const Instance& instance, double after_s) {
    const size_t index_count = counted_indices(instance, content);
    TopScene::Entry entry{slot, GeometryHandle(rtcNewGeometry(device.device.get(), RTC_GEOMETRY_TYPE_INSTANCE)),
                          device.bottom_of(instance.geometry, index_count), glm::mat3(1.0f)};
    rtcSetGeometryInstancedScene(entry.handle.get(), entry.bottom->scene.get());
    rtcSetGeometryMask(entry.handle.get(), instance.attributes.layers);
    top.set_transform(entry, instance, after_s);
    rtcAttachGeometryByID(top.scene.get(), entry.handle.get(), static_cast<unsigned>(top.entries.size()));
    top.entries.push_back(std::move(entry));
  }

  std::vector<uint32_t> counted_slots(std::span<const Instance> instances, bool of_moving) const {
    std::vector<uint32_t> slots;
    for (size_t slot = 0; slot < instances.size(); ++slot)
      if (instances[slot].moving == of_moving && counted_indices(instances[slot], content) > 0)
        slots.push_back(static_cast<uint32_t>(slot));
    return slots;
  }

  std::vector<uint32_t> counted_moving_slots(const SceneMirror& mirror) const {
    std::vector<uint32_t> slots(mirror.moving_slots().begin(), mirror.moving_slots().end());
    std::erase_if(slots, [&](uint32_t slot) { return counted_indices(mirror.instances()[slot], content) == 0; });
    return slots;
  }

  // Only transforms have changed. The anchor stays: movers seldom go far within one set.
  static void move_all(TopScene& top, std::span<const Instance> instances, double after_s) {
    if (top.entries.empty()) return;
    for (TopScene::Entry& entry : top.entries) top.set_transform(entry, instances[entry.slot], after_s);
    rtcCommitScene(top.scene.get());
  }

  void look_ahead(const SceneMirror& mirror, double after_s, bool same_set) {
    if (after_s <= 0) ahead = TopScene{};
    else if (same_set && ahead_s > 0) move_all(ahead, mirror.instances(), after_s);
    else build(ahead, mirror.instances(), counted_moving_slots(mirror), RTC_BUILD_QUALITY_LOW, after_s);
    ahead_s = after_s;
  }

  void take_in(const SceneMirror& mirror, double after_s) {
    const bool fresh = !taken_in || identity != mirror.identity();
    if (!fresh && version == mirror.version() && ahead_s == after_s) return;
    if (fresh || static_version != mirror.static_version())
      build(fixed, mirror.instances(), counted_slots(mirror.instances(), false), RTC_BUILD_QUALITY_HIGH);
    if (fresh || moving_version != mirror.moving_version())
      build(moving, mirror.instances(), counted_moving_slots(mirror), RTC_BUILD_QUALITY_LOW);
    else
      move_all(moving, mirror.instances(), 0.0);
    look_ahead(mirror, after_s, !fresh && moving_version == mirror.moving_version());
    taken_in = true;
    identity = mirror.identity();
    version = mirror.version();
    static_version = mirror.static_version();
    moving_version = mirror.moving_version();
  }
};

EmbreeScene::EmbreeScene(EmbreeDevice& device, Content content)
    : impl_(std::make_unique<Impl>(Impl{.device = *device.impl_, .content = content, .fixed = {}, .moving = {}, .ahead = {}})) {}
EmbreeScene::~EmbreeScene() = default;
EmbreeScene::EmbreeScene(EmbreeScene&&) noexcept = default;
EmbreeScene& EmbreeScene::operator=(EmbreeScene&&) noexcept = default;

void EmbreeScene::take_in(const SceneMirror& mirror, double ahead_s) {
  impl_->take_in(mirror, ahead_s);
}

RayHit EmbreeScene::trace(const glm::dvec3& origin_m, const glm::vec3& direction, float near, float far,
                          const RayFilter& filter) const {
  RayHit hit;
  trace_top(impl_->fixed, origin_m, direction, near, far, filter, hit);
  trace_top(filter.ahead ? impl_->ahead : impl_->moving, origin_m, direction, near, far, filter, hit);
  return hit;
}

float EmbreeScene::nearest_surface_m(const glm::dvec3& point_m, float reach_m,
                                     std::span<const uint32_t> ignored_slots) const {
  const float reach = nearest_in_top(impl_->fixed, point_m, reach_m, ignored_slots);
  return nearest_in_top(impl_->moving, point_m, reach, ignored_slots);
}

}  // namespace sightline
