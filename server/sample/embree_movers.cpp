#include "server/sample/embree_movers.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace sightline {
namespace {

// The greatest relative error of a difference of two single-precision numbers, with room for the products of a test.
constexpr float kRounding = 1e-6f;

}  // namespace

RayCone RayCone::around(std::span<const glm::vec3, 4> corners) {
  std::array<glm::vec3, 4> unit;
  glm::vec3 sum(0.0f);
  for (size_t i = 0; i < unit.size(); ++i) sum += unit[i] = glm::normalize(corners[i]);
  RayCone cone{.axis = glm::normalize(sum)};
  for (const glm::vec3& corner : unit) cone.cosine = std::min(cone.cosine, glm::dot(cone.axis, corner));
  cone.cosine = std::max(0.0f, cone.cosine - kRounding);
  cone.sine = std::sqrt(1.0f - cone.cosine * cone.cosine);
  return cone;
}

bool RayCone::may_meet(const glm::vec3& c, float radius_m) const {
  // The ball's centre is `beside` from the axis and `along` it; its distance from the cone's side, squared where
  // positive.
  const float along = glm::dot(axis, c);
  const glm::vec3 beside = glm::cross(axis, c);
  const float reach = along * sine + radius_m;
  return along >= -radius_m && reach >= 0 && glm::dot(beside, beside) * cosine * cosine <= reach * reach;
}

void EmbreeMovers::Centers::place(const SceneMirror& mirror, std::span<const uint32_t> slots,
                                  const glm::dvec3& anchor_m) {
  x.resize(slots.size());
  y.resize(slots.size());
  z.resize(slots.size());
  for (size_t i = 0; i < slots.size(); ++i) {
    const Instance& instance = mirror.instances()[slots[i]];
    const glm::dvec3 center = center_ahead_m(instance, ahead_s) - anchor_m;
    x[i] = static_cast<float>(center.x);
    y[i] = static_cast<float>(center.y);
    z[i] = static_cast<float>(center.z);
  }
}

void EmbreeMovers::list(EmbreeDevice::Impl& device, const SceneMirror& mirror) {
  slots_.clear();
  bottoms_.clear();
  radius_m_.clear();
  for (const uint32_t slot : mirror.moving_slots()) {
    const Instance& instance = mirror.instances()[slot];
    const size_t index_count = counted_indices(instance, EmbreeScene::Content::kOccluders);
    if (index_count == 0) continue;
    slots_.push_back(slot);
    bottoms_.push_back(device.bottom_of(instance.geometry, index_count));
    radius_m_.push_back(static_cast<float>(instance.radius_m));
  }
  marks_.resize(slots_.size());
  anchor_m_ = slots_.empty() ? glm::dvec3(0.0) : mirror.instances()[slots_[0]].center_m;
}

void EmbreeMovers::take_in(EmbreeDevice::Impl& device, const SceneMirror& mirror) {
  if (identity_ != mirror.identity() || moving_version_ != mirror.moving_version()) list(device, mirror);
  if (identity_ != mirror.identity() || version_ != mirror.version()) placed_ = 0;
  identity_ = mirror.identity();
  version_ = mirror.version();
  moving_version_ = mirror.moving_version();
}

const EmbreeMovers::Centers& EmbreeMovers::centers_in(const SceneMirror& mirror, double ahead_s) {
  for (size_t i = 0; i < placed_; ++i)
    if (centers_[i].ahead_s == ahead_s) return centers_[i];
  if (placed_ == centers_.size()) centers_.emplace_back();
  Centers& added = centers_[placed_++];
  added.ahead_s = ahead_s;
  added.place(mirror, slots_, anchor_m_);
  return added;
}

// RayCone::may_meet for all, without branches, so that the compiler tests several at once.
void EmbreeMovers::mark(const Centers& centers, const glm::vec3& eye, const RayCone& cone, float far_m,
                        float margin_m) {
  const float ax = cone.axis.x, ay = cone.axis.y, az = cone.axis.z, sine = cone.sine;
  const float squared_cosine = cone.cosine * cone.cosine;
  const float ex = eye.x, ey = eye.y, ez = eye.z;
  const float *xs = centers.x.data(), *ys = centers.y.data(), *zs = centers.z.data(), *radii = radius_m_.data();
  int32_t* marks = marks_.data();
  const size_t count = slots_.size();
  for (size_t i = 0; i < count; ++i) {
    const float x = xs[i] - ex, y = ys[i] - ey, z = zs[i] - ez;
    const float radius = radii[i] + margin_m + kRounding * (std::abs(x) + std::abs(y) + std::abs(z));
    const float along = ax * x + ay * y + az * z;
    const float bx = ay * z - az * y, by = az * x - ax * z, bz = ax * y - ay * x;
    const float reach = along * sine + radius, farthest = far_m + radius;
    marks[i] = (along >= -radius) & (reach >= 0.0f) &
               ((bx * bx + by * by + bz * bz) * squared_cosine <= reach * reach) &
               (x * x + y * y + z * z <= farthest * farthest);
  }
}

void EmbreeMovers::find(const SceneMirror& mirror, const MapRequest& request, const RayCone& cone,
                        std::vector<NearMover>& near) {
  near.clear();
  if (slots_.empty()) return;
  const Centers& centers = centers_in(mirror, request.ahead_s);
  const glm::dvec3& eye_m = request.view.eye_m;
  const glm::vec3 eye(eye_m - anchor_m_);
  const auto far_m = static_cast<float>(request.far_m * longest_direction(request.view));
  const float margin_m = kRounding * (std::abs(eye.x) + std::abs(eye.y) + std::abs(eye.z));
  mark(centers, eye, cone, far_m, margin_m);
  for (size_t i = 0; i < slots_.size(); ++i) {
    if (marks_[i] == 0) continue;
    const Instance& instance = mirror.instances()[slots_[i]];
    if ((instance.attributes.layers & request.layer_mask) == 0) continue;
    if (std::binary_search(request.ignored_slots.begin(), request.ignored_slots.end(), slots_[i])) continue;
    const Affine world_from_instance = world_from_instance_ahead(instance, request.ahead_s);
    const Affine instance_from_world = inverse(world_from_instance);
    const glm::dvec3 eye_in_instance = transform_point(instance_from_world, eye_m);
    // The mirror takes no instance so small that this could be (is_valid_linear).
    if (!is_traceable(eye_in_instance, glm::vec3(0.0f))) continue;
    NearMover& mover = near.emplace_back();
    mover.slot = slots_[i];
    mover.bottom = bottoms_[i].get();
    mover.center_from_eye_m = glm::vec3(center_ahead_m(instance, request.ahead_s) - eye_m);
    const float distance_m = glm::length(mover.center_from_eye_m);
    mover.radius_m = radius_m_[i] + kRounding * (radius_m_[i] + distance_m);
    mover.nearest_m = distance_m - mover.radius_m;
    mover.eye_in_instance = glm::vec3(eye_in_instance);
    mover.instance_from_world = glm::mat3(glm::mat4x3(instance_from_world));
  }
  std::sort(near.begin(), near.end(), [](const NearMover& a, const NearMover& b) {
    return a.nearest_m != b.nearest_m ? a.nearest_m < b.nearest_m : a.slot < b.slot;
  });
}

}  // namespace sightline
