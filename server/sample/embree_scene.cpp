#include "server/sample/embree_scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "server/sample/embree_parts.h"

namespace sightline {
namespace {

using Content = EmbreeScene::Content;

// Transpose of the adjugate: maps normals as the inverse transpose does, up to the determinant, whose sign is kept.
glm::vec3 transform_normal(const glm::mat3& linear, const glm::vec3& normal) {
  const glm::mat3 cofactor(glm::cross(linear[1], linear[2]), glm::cross(linear[2], linear[0]),
                           glm::cross(linear[0], linear[1]));
  const glm::vec3 out = cofactor * normal;
  return glm::dot(linear[0], cofactor[0]) < 0 ? -out : out;
}

// Embree asserts that rays stay below 1.8e18; no scene reaches a billionth of it. False for NaN.
bool is_traceable(const glm::dvec3& origin_m, const glm::vec3& direction) {
  const auto is_near = [](const glm::dvec3& v) {
    constexpr double kMost = 1e18;
    return std::abs(v.x) <= kMost && std::abs(v.y) <= kMost && std::abs(v.z) <= kMost;
  };
  return is_near(origin_m) && is_near(direction);
}

// Replaces `hit` when something nearer than it is hit.
void trace_top(const TopScene& top, const glm::dvec3& origin_m, const glm::vec3& direction, float near, float far,
               const RayFilter& filter, RayHit& hit) {
  if (top.entries.empty()) return;
  const glm::vec3 origin(origin_m - top.anchor_m);
  FilterContext context(top, filter);
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
  if (std::binary_search(query->ignored_slots.begin(), query->ignored_slots.end(), entry.slot)) return false;
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

// The moving instances at one time. Embree's handles are kept, so that a tick only sets what moved.
struct MovingTop {
  TopScene top;
  std::vector<GeometryHandle> handles;  // of top.entries

  void build(EmbreeDevice::Impl& device, const SceneMirror& mirror, Content content, double after_s);
  void move(const SceneMirror& mirror, double after_s);
};

void MovingTop::build(EmbreeDevice::Impl& device, const SceneMirror& mirror, Content content,
                      double after_s) {
  *this = MovingTop{};
  glm::dvec3 low(std::numeric_limits<double>::infinity()), high(-low);
  for (const uint32_t slot : mirror.moving_slots()) {
    const Instance& instance = mirror.instances()[slot];
    const size_t index_count = counted_indices(instance, content);
    if (index_count == 0) continue;
    top.entries.push_back({slot, device.bottom_of(instance.geometry, index_count), glm::mat3(1.0f)});
    low = glm::min(low, instance.center_m);
    high = glm::max(high, instance.center_m);
  }
  if (top.entries.empty()) return;
  top.anchor_m = 0.5 * (low + high);
  top.scene.reset(rtcNewScene(device.device.get()));
  rtcSetSceneFlags(top.scene.get(),
                   RTC_SCENE_FLAG_ROBUST | RTC_SCENE_FLAG_DYNAMIC | RTC_SCENE_FLAG_CONTEXT_FILTER_FUNCTION);
  rtcSetSceneBuildQuality(top.scene.get(), RTC_BUILD_QUALITY_LOW);
  for (TopScene::Entry& entry : top.entries) {
    handles.emplace_back(rtcNewGeometry(device.device.get(), RTC_GEOMETRY_TYPE_INSTANCE));
    rtcSetGeometryInstancedScene(handles.back().get(), entry.bottom->scene.get());
    rtcSetGeometryMask(handles.back().get(), mirror.instances()[entry.slot].attributes.layers);
    rtcAttachGeometryByID(top.scene.get(), handles.back().get(), static_cast<unsigned>(handles.size() - 1));
  }
  move(mirror, after_s);
}

// Only transforms have changed. The anchor stays: movers seldom go far within one set.
void MovingTop::move(const SceneMirror& mirror, double after_s) {
  if (top.entries.empty()) return;
  for (size_t i = 0; i < handles.size(); ++i)
    place_entry(top, top.entries[i], handles[i].get(),
                world_from_instance_ahead(mirror.instances()[top.entries[i].slot], after_s));
  rtcCommitScene(top.scene.get());
}

}  // namespace

struct EmbreeScene::Impl {
  const std::shared_ptr<EmbreeDevice::Impl> device;  // outlives the scenes below
  const Content content;
  bool taken_in = false;
  uint64_t identity = 0, version = 0, static_version = 0,
           moving_version = 0;  // of the mirror, as last taken in
  double ahead_s = 0.0;         // of `ahead`
  std::shared_ptr<const StaticTop> fixed = std::make_shared<StaticTop>();
  MovingTop moving, ahead;  // `ahead`: the moving ones in ahead_s; empty while nobody asks

  void look_ahead(const SceneMirror& mirror, double after_s, bool same_set) {
    if (after_s <= 0)
      ahead = MovingTop{};
    else if (same_set && ahead_s > 0)
      ahead.move(mirror, after_s);
    else
      ahead.build(*device, mirror, content, after_s);
    ahead_s = after_s;
  }

  void take_in(const SceneMirror& mirror, double after_s) {
    const bool fresh = !taken_in || identity != mirror.identity();
    if (!fresh && version == mirror.version() && ahead_s == after_s) return;
    if (fresh || static_version != mirror.static_version()) fixed = device->static_top_of(mirror, content);
    const bool same_set = !fresh && moving_version == mirror.moving_version();
    if (!same_set)
      moving.build(*device, mirror, content, 0.0);
    else if (version != mirror.version())
      moving.move(mirror, 0.0);
    look_ahead(mirror, after_s, same_set);
    taken_in = true;
    identity = mirror.identity();
    version = mirror.version();
    static_version = mirror.static_version();
    moving_version = mirror.moving_version();
  }
};

EmbreeScene::EmbreeScene(EmbreeDevice& device, Content content)
    : impl_(std::make_unique<Impl>(
          Impl{.device = device.impl(), .content = content, .moving = {}, .ahead = {}})) {}
EmbreeScene::~EmbreeScene() = default;
EmbreeScene::EmbreeScene(EmbreeScene&&) noexcept = default;
EmbreeScene& EmbreeScene::operator=(EmbreeScene&&) noexcept = default;

void EmbreeScene::take_in(const SceneMirror& mirror, double ahead_s) {
  impl_->take_in(mirror, ahead_s);
}

RayHit EmbreeScene::trace(const glm::dvec3& origin_m, const glm::vec3& direction, float near, float far,
                          const RayFilter& filter) const {
  RayHit hit;
  if (!is_traceable(origin_m, direction)) return hit;
  trace_top(impl_->fixed->top, origin_m, direction, near, far, filter, hit);
  trace_top(filter.ahead ? impl_->ahead.top : impl_->moving.top, origin_m, direction, near, far, filter, hit);
  return hit;
}

float EmbreeScene::nearest_surface_m(const glm::dvec3& point_m, float reach_m,
                                     std::span<const uint32_t> ignored_slots) const {
  const float reach = nearest_in_top(impl_->fixed->top, point_m, reach_m, ignored_slots);
  return nearest_in_top(impl_->moving.top, point_m, reach, ignored_slots);
}

}  // namespace sightline
