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

// False if a ray with this filter can hit nothing of `top`.
bool can_hit(const TopScene& top, const RayFilter& filter) {
  return !top.entries.empty() && (filter.only_slot == UINT32_MAX || top.holds(filter.only_slot));
}

RTCRay ray_in(const TopScene& top, const glm::dvec3& origin_m, const glm::vec3& direction, float near, float far,
              const RayFilter& filter) {
  const glm::vec3 origin(origin_m - top.anchor_m);
  return {origin.x, origin.y,          origin.z, near, direction.x, direction.y, direction.z, 0.0f,
          far,      filter.layer_mask, 0,        0};
}

// Replaces `hit` when something nearer than it is hit.
void trace_top(const TopScene& top, const glm::dvec3& origin_m, const glm::vec3& direction, float near, float far,
               const RayFilter& filter, RayHit& hit) {
  if (!can_hit(top, filter)) return;
  FilterContext context(top, filter);
  RTCRayHit query{};
  query.ray = ray_in(top, origin_m, direction, near, std::min(far, hit.distance_m), filter);
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  context.query.intersect(top.scene.get(), query);
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return;
  const TopScene::Entry& entry = top.entries[query.hit.instID[0]];
  hit.distance_m = query.ray.tfar;
  hit.slot = entry.slot;
  hit.normal = transform_normal(entry.linear, {query.hit.Ng_x, query.hit.Ng_y, query.hit.Ng_z});
}

bool is_blocked_in_top(const TopScene& top, const glm::dvec3& origin_m, const glm::vec3& direction, float near,
                       float far, const RayFilter& filter) {
  if (!can_hit(top, filter)) return false;
  FilterContext context(top, filter);
  RTCRay ray = ray_in(top, origin_m, direction, near, far, filter);
  context.query.occluded(top.scene.get(), ray);
  return ray.tfar < 0.0f;  // Embree's mark for a hit
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

}  // namespace

struct EmbreeScene::Impl {
  const std::shared_ptr<EmbreeDevice::Impl> device;  // outlives the scenes below
  const Content content;
  uint64_t identity = 0, version = 0, static_version = 0;  // of the mirror, as last taken in; identity 0: never
  double ahead_s = 0.0;                                    // of `ahead`
  std::shared_ptr<const StaticTop> fixed = std::make_shared<StaticTop>();
  TopScene moving = {}, ahead = {};  // `ahead`: the moving instances in ahead_s

  void take_in(const SceneMirror& mirror, double after_s) {
    const bool fresh = identity != mirror.identity();
    if (!fresh && version == mirror.version() && ahead_s == after_s) return;
    if (fresh || static_version != mirror.static_version()) fixed = device->static_top_of(mirror, content);
    moving = device->moving_top_of(mirror, content, 0.0);
    ahead = after_s > 0 ? device->moving_top_of(mirror, content, after_s) : TopScene{};
    identity = mirror.identity();
    version = mirror.version();
    static_version = mirror.static_version();
    ahead_s = after_s;
  }
};

EmbreeScene::EmbreeScene(EmbreeDevice& device, Content content)
    : impl_(std::make_unique<Impl>(Impl{.device = device.impl(), .content = content})) {}
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
  trace_top(filter.ahead ? impl_->ahead : impl_->moving, origin_m, direction, near, far, filter, hit);
  return hit;
}

bool EmbreeScene::is_blocked(const glm::dvec3& origin_m, const glm::vec3& direction, float near, float far,
                             const RayFilter& filter) const {
  if (!is_traceable(origin_m, direction)) return false;
  const TopScene& moving = filter.ahead ? impl_->ahead : impl_->moving;
  return is_blocked_in_top(impl_->fixed->top, origin_m, direction, near, far, filter) ||
         is_blocked_in_top(moving, origin_m, direction, near, far, filter);
}

float EmbreeScene::nearest_surface_m(const glm::dvec3& point_m, float reach_m,
                                     std::span<const uint32_t> ignored_slots) const {
  const float reach = nearest_in_top(impl_->fixed->top, point_m, reach_m, ignored_slots);
  return nearest_in_top(impl_->moving, point_m, reach, ignored_slots);
}

}  // namespace sightline
