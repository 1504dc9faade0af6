// The device builds each bottom scene once for each geometry, and each static top scene once for equal static
// instances.
#include <algorithm>
#include <array>
#include <cassert>
#include <cstring>
#include <string>

#include "server/base/cpu_budget.h"
#include "server/base/hash.h"
#include "server/sample/embree_parts.h"

namespace sightline {
namespace {

using Content = EmbreeScene::Content;

// Without it, Embree starts a thread for each CPU of the machine. A container that may use fewer says so by its quota,
// which Embree does not read.
std::string device_configuration() {
  return "threads=" + std::to_string(cpu_budget());
}

// Above this size a hierarchy with spatial splits is not worth the time that it takes to build.
constexpr size_t kMaxTrianglesOfHighQuality = 1'000'000;

const RTCSceneFlags kSceneFlags = RTC_SCENE_FLAG_ROBUST | kFilterByQuery;

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
  // Embree's compact layout would save a quarter of the bytes on small meshes, but be up to 50 % slower on large ones.
  const RTCBuildQuality quality = index_count / 3 <= kMaxTrianglesOfHighQuality ? RTC_BUILD_QUALITY_HIGH
                                                                                : RTC_BUILD_QUALITY_MEDIUM;
  // Layers belong to the instances; here every bit is set.
  rtcSetGeometryMask(mesh.get(), 0xFFFFFFFF);
  rtcSetGeometryBuildQuality(mesh.get(), quality);
  rtcCommitGeometry(mesh.get());

  bottom->scene.reset(rtcNewScene(device));
  rtcSetSceneFlags(bottom->scene.get(), kSceneFlags);
  rtcSetSceneBuildQuality(bottom->scene.get(), quality);
  rtcAttachGeometry(bottom->scene.get(), mesh.get());
  rtcCommitScene(bottom->scene.get());
  return bottom;
}

// The middle of the instances that the scene will hold, so that single precision serves all of them equally.
glm::dvec3 middle(const SceneMirror& mirror, std::span<const Placement> placements) {
  glm::dvec3 low(std::numeric_limits<double>::infinity()), high(-low);
  for (const Placement& placement : placements) {
    low = glm::min(low, mirror.instances()[placement.slot].center_m);
    high = glm::max(high, mirror.instances()[placement.slot].center_m);
  }
  return 0.5 * (low + high);
}

// The instances of one top scene: static ones, or moving ones where they will be in `ahead_s`.
struct Placed {
  std::vector<Placement> placements;
  std::vector<std::shared_ptr<const BottomScene>> bottoms;  // of the placements
};
Placed place(EmbreeDevice::Impl& device, const SceneMirror& mirror, Content content, bool moving, double ahead_s) {
  Placed placed;
  for (uint32_t slot = 0; slot < mirror.instances().size(); ++slot) {
    const Instance& instance = mirror.instances()[slot];
    const size_t index_count = instance.moving == moving ? counted_indices(instance, content) : 0;
    if (index_count == 0) continue;
    placed.bottoms.push_back(device.bottom_of(instance.geometry, index_count));
    placed.placements.push_back(
        {slot, instance.attributes.layers, placed.bottoms.back().get(), world_from_instance_ahead(instance, ahead_s)});
  }
  return placed;
}

TopScene build_top(RTCDevice device, const SceneMirror& mirror, const Placed& placed, RTCBuildQuality quality) {
  TopScene top;
  if (placed.placements.empty()) return top;
  top.anchor_m = middle(mirror, placed.placements);
  top.scene.reset(rtcNewScene(device));
  rtcSetSceneFlags(top.scene.get(), kSceneFlags);
  rtcSetSceneBuildQuality(top.scene.get(), quality);
  top.entries.reserve(placed.placements.size());
  for (size_t i = 0; i < placed.placements.size(); ++i) {
    const Placement& placement = placed.placements[i];
    Affine from_instance = placement.world_from_instance;
    from_instance[3] -= top.anchor_m;
    const glm::mat4x3 columns(from_instance);
    const GeometryHandle handle(rtcNewGeometry(device, RTC_GEOMETRY_TYPE_INSTANCE));
    rtcSetGeometryInstancedScene(handle.get(), placement.bottom->scene.get());
    rtcSetGeometryMask(handle.get(), placement.layers);
    rtcSetGeometryTransform(handle.get(), 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, &columns[0].x);
    rtcCommitGeometry(handle.get());
    rtcAttachGeometryByID(top.scene.get(), handle.get(), static_cast<unsigned>(i));
    top.entries.push_back({placement.slot, placed.bottoms[i], glm::mat3(columns)});
  }
  rtcCommitScene(top.scene.get());
  return top;
}

bool add_bytes(void* total, ssize_t bytes, bool) {
  static_cast<std::atomic<ssize_t>*>(total)->fetch_add(bytes, std::memory_order_relaxed);
  return true;
}

bool is_ignored(uint32_t slot, std::span<const uint32_t> ignored_slots) {
  return std::binary_search(ignored_slots.begin(), ignored_slots.end(), slot);
}

void reject_filtered(const RTCFilterFunctionNArguments* args) {
  const auto* context = reinterpret_cast<const FilterContext*>(args->context);
  const RayFilter& filter = *context->filter;
  for (unsigned i = 0; i < args->N; ++i) {
    if (args->valid[i] == 0) continue;
    const uint32_t slot = context->top->entries[RTCHitN_instID(args->hit, args->N, i, 0)].slot;
    const bool other = filter.only_slot != UINT32_MAX && slot != filter.only_slot;
    if (other || is_ignored(slot, filter.ignored_slots)) args->valid[i] = 0;
  }
}

}  // namespace

size_t counted_indices(const Instance& instance, Content content) {
  if (!instance.geometry) return 0;
  if (content == Content::kOccluders) return instance.occludes() ? instance.geometry->occluding_index_count : 0;
  return instance.collides() ? instance.geometry->indices.size() : 0;
}

bool TopScene::holds(uint32_t slot) const {
  const auto at = std::lower_bound(entries.begin(), entries.end(), slot,
                                   [](const Entry& entry, uint32_t wanted) { return entry.slot < wanted; });
  return at != entries.end() && at->slot == slot;
}

FilterContext::FilterContext(const TopScene& filtered_top, const RayFilter& ray_filter)
    : top(&filtered_top), filter(&ray_filter) {
  const bool ignores = std::ranges::any_of(ray_filter.ignored_slots,
                                           [&](uint32_t slot) { return filtered_top.holds(slot); });
  if (ignores || ray_filter.only_slot != UINT32_MAX) query.filter_by(reject_filtered);
}

EmbreeDevice::Impl::Impl() : device(rtcNewDevice(device_configuration().c_str())) {
  assert(device);
  assert(rtcGetDeviceProperty(device.get(), RTC_DEVICE_PROPERTY_RAY_MASK_SUPPORTED));
  assert(rtcGetDeviceProperty(device.get(), RTC_DEVICE_PROPERTY_FILTER_FUNCTION_SUPPORTED));
  rtcSetDeviceMemoryMonitorFunction(device.get(), add_bytes, &bytes);
}

std::shared_ptr<const BottomScene> EmbreeDevice::Impl::find(const BottomKey& key) {
  const auto found = bottoms.find(key);
  // Another geometry may have the address of one that has died.
  if (found == bottoms.end() || found->second.geometry.expired()) return nullptr;
  return found->second.scene;
}

void EmbreeDevice::Impl::forget_dead() {
  // Releases dead scenes after the lock.
  std::vector<std::shared_ptr<const BottomScene>> dead;
  const MutexLock lock(mutex);
  std::erase_if(bottoms, [&](const auto& item) {
    if (!item.second.geometry.expired()) return false;
    dead.push_back(item.second.scene);
    return true;
  });
  std::erase_if(statics, [](const auto& item) { return item.second.expired(); });
}

std::shared_ptr<const BottomScene> EmbreeDevice::Impl::bottom_of(const std::shared_ptr<const Geometry>& geometry,
                                                                 size_t index_count) {
  const BottomKey key{geometry.get(), index_count};
  {
    const MutexLock lock(mutex);
    if (auto bottom = find(key)) return bottom;
  }
  auto built = build_bottom(device.get(), *geometry, index_count);
  const MutexLock lock(mutex);
  Bottom& bottom = bottoms[key];
  if (bottom.geometry.expired()) bottom = {geometry, std::move(built)};
  return bottom.scene;
}

std::shared_ptr<const StaticTop> EmbreeDevice::Impl::find(uint64_t hash, std::span<const Placement> placements) {
  const auto [first, last] = statics.equal_range(hash);
  for (auto it = first; it != last; ++it)
    // Equal hashes are not enough: all placements are compared.
    if (auto alive = it->second.lock();
        alive && alive->placements.size() == placements.size() &&
        (placements.empty() || std::memcmp(alive->placements.data(), placements.data(), placements.size_bytes()) == 0))
      return alive;
  return nullptr;
}

std::shared_ptr<const StaticTop> EmbreeDevice::Impl::static_top_of(const SceneMirror& mirror, Content content) {
  const Placed placed = place(*this, mirror, content, false, 0.0);
  const uint64_t hash = hash64_bytes(std::as_bytes(std::span(placed.placements)));
  {
    const MutexLock lock(mutex);
    if (auto found = find(hash, placed.placements)) return found;
  }
  auto made = std::make_shared<StaticTop>(
      StaticTop{build_top(device.get(), mirror, placed, RTC_BUILD_QUALITY_HIGH), placed.placements});
  forget_dead();
  const MutexLock lock(mutex);
  if (auto found = find(hash, placed.placements)) return found;  // another thread was faster
  statics.emplace(hash, made);
  return made;
}

TopScene EmbreeDevice::Impl::moving_top_of(const SceneMirror& mirror, Content content, double ahead_s) {
  return build_top(device.get(), mirror, place(*this, mirror, content, true, ahead_s), RTC_BUILD_QUALITY_LOW);
}

EmbreeDevice::EmbreeDevice() : impl_(std::make_shared<Impl>()) {}
EmbreeDevice::~EmbreeDevice() = default;

std::string EmbreeDevice::version() {
  return RTC_VERSION_STRING;
}

void EmbreeDevice::forget_unused() {
  impl_->forget_dead();
}

size_t EmbreeDevice::geometry_bytes() const {
  impl_->forget_dead();
  return static_cast<size_t>(std::max<ssize_t>(0, impl_->bytes.load(std::memory_order_relaxed)));
}

}  // namespace sightline
