#include "server/sample/embree_maps.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "server/base/vector_clones.h"

namespace sightline {
namespace {

constexpr int kRays = 16;  // a packet; devices without vectors as wide take it in parts
constexpr float kInfinity = std::numeric_limits<float>::infinity();

// Wider packets, on the plane one unit before the eye, are faster without Embree's flag for coherent rays. On maps of 7
// and 16 texels a side over a city both were equally fast at widths of 0.25 to 0.35.
constexpr double kCoherentWidth = 0.25;

// World directions of a map's texels, one unit of depth along the view axis: `first` + x `right` + y `up`.
struct TexelRays {
  glm::dvec3 first, right, up;
  explicit TexelRays(const MapView& view)
      : first(texel_direction(view, 0, 0)),
        right(view.world_from_view[0] * ((view.right - view.left) / view.width)),
        up(view.world_from_view[1] * ((view.top - view.bottom) / view.height)) {}
  glm::vec3 at(double x, double y) const { return glm::vec3(first + right * x + up * y); }
  RayCone cone(double x, double y, double width, double height) const {
    const double x1 = x + width - 1, y1 = y + height - 1;
    return RayCone::around(std::array{at(x, y), at(x1, y), at(x, y1), at(x1, y1)});
  }
};

// The ray of a map of one texel, for which a packet would be slower. Distances are in lengths of the world direction.
class SingleRay {
 public:
  SingleRay(const MapRequest& request, float far) {
    query_.ray.tnear = static_cast<float>(request.view.near_m);
    query_.ray.tfar = far;
  }

  // True when the ray hits something nearer than all its hits before.
  bool meets(RTCScene scene, QueryContext& context, const glm::vec3& origin, const glm::vec3& direction,
             uint32_t mask) {
    query_.ray.org_x = origin.x, query_.ray.org_y = origin.y, query_.ray.org_z = origin.z;
    query_.ray.dir_x = direction.x, query_.ray.dir_y = direction.y, query_.ray.dir_z = direction.z;
    query_.ray.mask = mask;
    query_.hit.geomID = query_.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    context.intersect(scene, query_);
    return query_.hit.geomID != RTC_INVALID_GEOMETRY_ID;
  }
  unsigned instance() const { return query_.hit.instID[0]; }
  float distance() const { return query_.ray.tfar; }

 private:
  RTCRayHit query_ = {};
};

// Directions first + right * x + up * y in double precision, rounded, and their lengths.
SIGHTLINE_VECTOR_CLONES
void set_directions(const glm::dvec3& first, const glm::dvec3& right, const glm::dvec3& up, const double* __restrict x,
                    const double* __restrict y, RTCRay16& rays, float* __restrict length) {
  const double first_x = first.x, first_y = first.y, first_z = first.z, right_x = right.x, right_y = right.y,
               right_z = right.z, up_x = up.x, up_y = up.y, up_z = up.z;
  for (int i = 0; i < kRays; ++i) {
    const auto dx = static_cast<float>(first_x + right_x * x[i] + up_x * y[i]);
    const auto dy = static_cast<float>(first_y + right_y * x[i] + up_y * y[i]);
    const auto dz = static_cast<float>(first_z + right_z * x[i] + up_z * y[i]);
    rays.dir_x[i] = dx;
    rays.dir_y[i] = dy;
    rays.dir_z[i] = dz;
    length[i] = std::sqrt(dx * dx + dy * dy + dz * dz);
  }
}

template <typename T>
void fill(T (&lanes)[kRays], T value) {
  std::fill(std::begin(lanes), std::end(lanes), value);
}

}  // namespace

PacketShape packet_shape(int map_width, int map_height) {
  PacketShape best;
  int best_packets = map_width * map_height;
  for (int width = 1; width <= std::min(map_width, kRays); ++width) {
    const int height = std::min(map_height, kRays / width);
    const int packets = ((map_width + width - 1) / width) * ((map_height + height - 1) / height);
    const bool rounder = packets == best_packets && width + height < best.width + best.height;
    if (packets > best_packets || (packets == best_packets && !rounder)) continue;
    best = {width, height};
    best_packets = packets;
  }
  return best;
}

// The rays of one rectangle of texels, and the data that all packets of a map share.
struct EmbreeMaps::Packet {
  alignas(64) RTCRayHit16 rays;   // world directions, origins from the static top's anchor
  alignas(64) RTCRayHit16 local;  // the same in one mover's frame
  alignas(64) int valid[kRays];
  alignas(64) float length[kRays];  // of the directions
  alignas(64) uint32_t slot[kRays];
  alignas(64) double x[kRays], y[kRays];  // of the shape's texels
  uint32_t texel[kRays];                  // of a map, from the shape's first
  QueryContext mover_context;
  int map_width = 0, map_height = 0;
  PacketShape shape;  // of maps of this size

  void begin_map(const MapRequest& request, const glm::vec3& origin);
  void take_shape(int width, int height);
  void aim(const MapRequest& request, const TexelRays& texels, int x0, int y0);
  void meet_static(const TopScene& top, FilterContext& context);
  void meet(const NearMover& mover);
  float farthest_m() const;
  void store(int x0, int y0, DepthMap& map) const;
};

void EmbreeMaps::Packet::begin_map(const MapRequest& request, const glm::vec3& origin) {
  for (RTCRayHit16* each : {&rays, &local}) {
    fill(each->ray.tnear, static_cast<float>(request.view.near_m));
    fill(each->ray.time, 0.0f);
    fill(each->ray.flags, 0u);
    fill(each->ray.id, 0u);
    fill(each->hit.geomID, RTC_INVALID_GEOMETRY_ID);
    fill(each->hit.instID[0], RTC_INVALID_GEOMETRY_ID);
  }
  fill(rays.ray.mask, request.layer_mask);
  fill(local.ray.mask, 0xFFFFFFFFu);
  fill(rays.ray.org_x, origin.x);
  fill(rays.ray.org_y, origin.y);
  fill(rays.ray.org_z, origin.z);
}

void EmbreeMaps::Packet::take_shape(int width, int height) {
  map_width = width, map_height = height;
  shape = packet_shape(width, height);
  for (int i = 0; i < kRays; ++i) {
    x[i] = i % shape.width;
    y[i] = i / shape.width;
    texel[i] = static_cast<uint32_t>(i / shape.width * width + i % shape.width);
  }
}

void EmbreeMaps::Packet::aim(const MapRequest& request, const TexelRays& texels, int x0, int y0) {
  const glm::dvec3 first = texels.first + texels.right * double(x0) + texels.up * double(y0);
  set_directions(first, texels.right, texels.up, x, y, rays.ray, length);
  const auto far_m = static_cast<float>(request.far_m);
  const int columns = std::min(shape.width, request.view.width - x0),
            rows = std::min(shape.height, request.view.height - y0);
  for (int i = 0; i < kRays; ++i) {
    rays.ray.tfar[i] = far_m;
    valid[i] = (x[i] < columns) & (y[i] < rows) ? -1 : 0;
    slot[i] = kNoOccluder;
  }
}

void EmbreeMaps::Packet::meet_static(const TopScene& top, FilterContext& context) {
  fill(rays.hit.geomID, RTC_INVALID_GEOMETRY_ID);
  context.query.intersect(valid, top.scene.get(), rays);
  for (int i = 0; i < kRays; ++i)
    if (valid[i] != 0 && rays.hit.geomID[i] != RTC_INVALID_GEOMETRY_ID)
      slot[i] = top.entries[rays.hit.instID[0][i]].slot;
}

void EmbreeMaps::Packet::meet(const NearMover& mover) {
  const glm::mat3& m = mover.instance_from_world;
  for (int i = 0; i < kRays; ++i) {
    const float dx = rays.ray.dir_x[i], dy = rays.ray.dir_y[i], dz = rays.ray.dir_z[i];
    local.ray.org_x[i] = mover.eye_in_instance.x;
    local.ray.org_y[i] = mover.eye_in_instance.y;
    local.ray.org_z[i] = mover.eye_in_instance.z;
    local.ray.dir_x[i] = m[0].x * dx + m[1].x * dy + m[2].x * dz;
    local.ray.dir_y[i] = m[0].y * dx + m[1].y * dy + m[2].y * dz;
    local.ray.dir_z[i] = m[0].z * dx + m[1].z * dy + m[2].z * dz;
    local.ray.tfar[i] = rays.ray.tfar[i];
    local.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
  }
  mover_context.intersect(valid, mover.bottom->scene.get(), local);
  for (int i = 0; i < kRays; ++i) {
    if (valid[i] == 0 || local.hit.geomID[i] == RTC_INVALID_GEOMETRY_ID) continue;
    rays.ray.tfar[i] = local.ray.tfar[i];
    slot[i] = mover.slot;
  }
}

// The farthest end of a ray of the packet.
float EmbreeMaps::Packet::farthest_m() const {
  float farthest = 0.0f;
  for (int i = 0; i < kRays; ++i)
    if (valid[i] != 0) farthest = std::max(farthest, rays.ray.tfar[i] * length[i]);
  return farthest;
}

void EmbreeMaps::Packet::store(int x0, int y0, DepthMap& map) const {
  const size_t first = static_cast<size_t>(y0) * map.view.width + x0;
  for (int i = 0; i < kRays; ++i) {
    if (valid[i] == 0) continue;
    map.distance_m[first + texel[i]] = slot[i] == kNoOccluder ? kInfinity : rays.ray.tfar[i] * length[i];
    map.occluder[first + texel[i]] = slot[i];
  }
}

EmbreeMaps::EmbreeMaps(EmbreeDevice& device)
    : device_(device.impl()), fixed_(std::make_shared<StaticTop>()), packet_(std::make_unique<Packet>()) {}
EmbreeMaps::~EmbreeMaps() = default;

void EmbreeMaps::take_in(const SceneMirror& mirror) {
  if (identity_ != mirror.identity() || static_version_ != mirror.static_version())
    fixed_ = device_->static_top_of(mirror, EmbreeScene::Content::kOccluders);
  identity_ = mirror.identity();
  static_version_ = mirror.static_version();
  movers_.take_in(*device_, mirror);
}

// A filter that Embree calls for every hit costs a third of the time, so it is set only when a ray can hit an ignored
// instance.
bool EmbreeMaps::static_filter_needed(const SceneMirror& mirror, const MapRequest& request, const RayCone& cone) const {
  return std::any_of(request.ignored_slots.begin(), request.ignored_slots.end(), [&](uint32_t slot) {
    if (!fixed_->top.holds(slot)) return false;
    const Instance& instance = mirror.instances()[slot];
    const glm::vec3 center(instance.center_m - request.view.eye_m);
    return cone.may_meet(center,
                         static_cast<float>(1.001 * instance.radius_m + 1e-5 * glm::length(glm::dvec3(center))));
  });
}

void EmbreeMaps::take(const SceneMirror& mirror, const MapRequest& request, DepthMap& map) {
  const MapView& view = request.view;
  map.view = view;
  map.ahead_s = request.ahead_s;
  map.distance_m.resize(static_cast<size_t>(view.width) * view.height);
  map.occluder.resize(map.distance_m.size());
  if (map.distance_m.size() == 1)
    take_sight(mirror, request, map);
  else
    take_packets(mirror, request, map);
}

void EmbreeMaps::take_sight(const SceneMirror& mirror, const MapRequest& request, DepthMap& map) {
  const glm::vec3 direction(texel_direction(request.view, 0, 0));
  const float length = glm::length(direction);
  const RayCone cone{.axis = direction / length};
  const TopScene& top = fixed_->top;
  SingleRay ray(request, static_cast<float>(request.far_m));
  uint32_t slot = kNoOccluder;
  const RayFilter filter{.ignored_slots = static_filter_needed(mirror, request, cone) ? request.ignored_slots
                                                                                      : std::span<const uint32_t>()};
  FilterContext context(top, filter);
  if (top.scene && ray.meets(top.scene.get(), context.query, glm::vec3(request.view.eye_m - top.anchor_m), direction,
                             request.layer_mask))
    slot = top.entries[ray.instance()].slot;
  movers_.find(mirror, request, cone, near_);
  QueryContext plain;
  for (const NearMover& mover : near_)
    if (mover.nearest_m <= ray.distance() * length &&
        ray.meets(mover.bottom->scene.get(), plain, mover.eye_in_instance, mover.instance_from_world * direction, ~0u))
      slot = mover.slot;
  map.distance_m[0] = slot == kNoOccluder ? kInfinity : ray.distance() * length;
  map.occluder[0] = slot;
}

void EmbreeMaps::take_packets(const SceneMirror& mirror, const MapRequest& request, DepthMap& map) {
  const MapView& view = request.view;
  const TopScene& top = fixed_->top;
  const TexelRays texels(view);
  const RayCone cone = texels.cone(0, 0, view.width, view.height);
  const RayFilter filter{.ignored_slots = static_filter_needed(mirror, request, cone) ? request.ignored_slots
                                                                                      : std::span<const uint32_t>()};
  FilterContext context(top, filter);
  movers_.find(mirror, request, cone, near_);

  Packet& packet = *packet_;
  if (packet.map_width != view.width || packet.map_height != view.height) packet.take_shape(view.width, view.height);
  packet.begin_map(request, glm::vec3(view.eye_m - top.anchor_m));
  const double width = std::max(packet.shape.width * (view.right - view.left) / view.width,
                                packet.shape.height * (view.top - view.bottom) / view.height);
  if (width <= kCoherentWidth) context.query.expect_coherent_rays();
  packet.mover_context = {};
  packet.mover_context.expect_coherent_rays();

  for (int y = 0; y < view.height; y += packet.shape.height)
    for (int x = 0; x < view.width; x += packet.shape.width) {
      packet.aim(request, texels, x, y);
      if (top.scene) packet.meet_static(top, context);
      // Sorted by distance: beyond the first that is too far, all are.
      if (!near_.empty() && near_.front().nearest_m <= packet.farthest_m()) {
        const RayCone part = texels.cone(x, y, packet.shape.width, packet.shape.height);
        for (const NearMover& mover : near_)
          if (part.may_meet(mover.center_from_eye_m, mover.radius_m) && mover.nearest_m <= packet.farthest_m())
            packet.meet(mover);
      }
      packet.store(x, y, map);
    }
}

}  // namespace sightline
