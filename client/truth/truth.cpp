#include "client/truth/truth.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace sightline {
namespace {

std::vector<uint32_t> slots_of(const SceneMirror& mirror, std::span<const uint64_t> ids) {
  std::vector<uint32_t> slots;
  for (const uint64_t id : ids)
    if (const auto slot = mirror.slot_of(id)) slots.push_back(*slot);
  return slots;
}

// The slots of the instances that never occlude the target, in ascending order.
std::vector<uint32_t> see_through_slots(const SceneMirror& mirror, const Target& target) {
  std::vector<uint32_t> slots = slots_of(mirror, target.attached_ids);
  const std::vector<uint32_t> ignored = slots_of(mirror, target.ignored_ids);
  slots.insert(slots.end(), ignored.begin(), ignored.end());
  std::sort(slots.begin(), slots.end());
  slots.erase(std::unique(slots.begin(), slots.end()), slots.end());
  return slots;
}

// The mirror slots of the target's own instance and of its parts, without those that are switched off. If all are
// switched off, the slot of the own instance alone.
std::vector<uint32_t> body_slots(const SceneMirror& mirror, const Target& target) {
  const uint32_t own = *mirror.slot_of(target.instance_id);
  std::vector<uint32_t> slots = slots_of(mirror, target.part_ids);
  slots.insert(slots.begin(), own);
  if (slots.size() == 1) return slots;
  std::erase_if(slots, [&](uint32_t slot) { return !mirror.instances()[slot].attributes.visible; });
  return slots.empty() ? std::vector{own} : slots;
}

struct Eye {
  const Pose& pose;
  const Lens& lens;
  int size;
};

// The corners of an instance's bounding box in the camera's frame.
std::array<glm::dvec3, 8> corners_in_camera(const Pose& world_from_camera, const Instance& instance) {
  const Aabb& bounds = instance.geometry->bounds;
  std::array<glm::dvec3, 8> corners;
  for (int k = 0; k < 8; ++k) {
    const glm::dvec3 corner(k & 1 ? bounds.max.x : bounds.min.x, k & 2 ? bounds.max.y : bounds.min.y,
                            k & 4 ? bounds.max.z : bounds.min.z);
    corners[k] = inverse_transform_point(world_from_camera, transform_point(instance.world_from_instance, corner));
  }
  return corners;
}

// The samples that an instance can cover: those that its bounding sphere and its bounding box both can cover. The box
// is tighter round a standing person. A box that reaches behind the eye bounds nothing.
PixelBox instance_pixels(const Pose& world_from_camera, const Lens& lens, const Instance& instance, int size) {
  PixelBox box = sphere_pixels(world_from_camera, lens, instance.center_m, instance.radius_m, size, size);
  const double half_height = std::tan(lens.vertical_fov_rad / 2), half_width = half_height * lens.aspect;
  glm::dvec2 low(INFINITY), high(-INFINITY);
  for (const glm::dvec3& corner : corners_in_camera(world_from_camera, instance)) {
    if (corner.z > -1e-3) return box;
    const glm::dvec2 window(corner.x / -corner.z / half_width, corner.y / -corner.z / half_height);
    low = glm::min(low, window);
    high = glm::max(high, window);
  }
  // One more sample on each side, so that rounding loses none.
  const auto sample = [size](double w) {
    return static_cast<int>(std::floor((std::clamp(w, -1.1, 1.1) + 1) / 2 * size));
  };
  box.x0 = std::max(box.x0, sample(low.x) - 1), box.x1 = std::min(box.x1, sample(high.x) + 2);
  box.y0 = std::max(box.y0, sample(low.y) - 1), box.y1 = std::min(box.y1, sample(high.y) + 2);
  return box;
}

// Counts the pixels of one target.
class TargetLook {
 public:
  TargetLook(const EmbreeScene& scene, const SceneMirror& mirror, const Target& target, const Eye& eye)
      : scene_(scene),
        eye_(eye),
        instances_(mirror.instances()),
        instance_(*mirror.find(target.instance_id)),
        layer_mask_(target.layer_mask),
        body_(body_slots(mirror, target)),
        see_through_(see_through_slots(mirror, target)) {
    for (const uint32_t slot : body_) own_is_drawn_ &= (instances_[slot].attributes.layers & layer_mask_) != 0;
  }

  TargetTruth take() {
    TargetTruth truth;
    truth.id = instance_.id;
    truth.in_frame = center_in_frame();
    const PixelBox box = body_pixels();
    for (int y = box.y0; y < box.y1; ++y)
      for (int x = box.x0; x < box.x1; ++x) count(x, y, truth);
    return truth;
  }

 private:
  // One ray decides most pixels: either it meets the target first, or it meets nothing as far as the target reaches.
  void count(int x, int y, TargetTruth& truth) const {
    const glm::vec3 direction(sample_direction(eye_.pose, eye_.lens, x + 0.5, y + 0.5, eye_.size, eye_.size));
    const float reach = reach_beyond_target(direction);
    RayFilter others;
    others.layer_mask = layer_mask_;
    others.ignored_slots = see_through_;
    const RayHit first = scene_.trace(eye_.pose.position_m, direction, near(), reach, others);
    if (first.slot == UINT32_MAX && own_is_drawn_) return;
    const bool own_is_first = std::ranges::find(body_, first.slot) != body_.end();
    const RayHit own = own_is_first ? first : trace_alone(direction, reach);
    if (own.slot == UINT32_MAX) return;
    ++truth.alone_pixels;
    if (own.distance_m <= first.distance_m) ++truth.visible_pixels;
  }

  // The first hit with the body, as if nothing else were there.
  RayHit trace_alone(const glm::vec3& direction, float reach) const {
    RayHit nearest;
    for (const uint32_t slot : body_) {
      RayFilter alone;
      alone.only_slot = slot;
      const RayHit hit = scene_.trace(eye_.pose.position_m, direction, near(), reach, alone);
      if (hit.distance_m < nearest.distance_m) nearest = hit;
    }
    return nearest;
  }

  PixelBox body_pixels() const {
    PixelBox all;
    for (const uint32_t slot : body_) {
      const PixelBox box = instance_pixels(eye_.pose, eye_.lens, instances_[slot], eye_.size);
      if (box.x0 >= box.x1 || box.y0 >= box.y1) continue;
      const bool is_first = all.x0 >= all.x1;
      all = is_first ? box
                     : PixelBox{std::min(all.x0, box.x0), std::min(all.y0, box.y0), std::max(all.x1, box.x1),
                                std::max(all.y1, box.y1)};
    }
    return all;
  }

  float near() const { return static_cast<float>(eye_.lens.near_m); }

  // No ray meets the target beyond its bounding spheres; the limit spares Embree the search.
  float reach_beyond_target(const glm::vec3& direction) const {
    double far = 0;
    for (const uint32_t slot : body_)
      far = std::max(far, glm::distance(instances_[slot].center_m, eye_.pose.position_m) + instances_[slot].radius_m);
    return static_cast<float>(1.001 * far / glm::length(direction));
  }

  bool center_in_frame() const {
    const glm::dvec3 p = inverse_transform_point(eye_.pose, instance_.center_m);
    const double half_height = -p.z * std::tan(eye_.lens.vertical_fov_rad / 2);
    return p.z < 0 && std::abs(p.y) <= half_height && std::abs(p.x) <= half_height * eye_.lens.aspect;
  }

  const EmbreeScene& scene_;
  const Eye& eye_;
  const std::span<const Instance> instances_;
  const Instance& instance_;
  const uint32_t layer_mask_;
  const std::vector<uint32_t> body_, see_through_;
  bool own_is_drawn_ = true;
};

// The interval of tangents (coordinate / depth) that a circle at (coordinate, depth) covers, seen from the origin.
// False when the origin is inside the circle or the circle reaches behind the eye: then nothing bounds it.
bool tangent_interval(double coordinate, double depth, double radius, double& low, double& high) {
  const double distance = std::hypot(coordinate, depth);
  if (distance <= radius) return false;
  const double middle = std::atan2(coordinate, depth), half = std::asin(radius / distance);
  constexpr double kQuarter = 1.5707;
  if (middle - half <= -kQuarter || middle + half >= kQuarter) return false;
  low = std::tan(middle - half);
  high = std::tan(middle + half);
  return true;
}

// [from, to) of `count` samples over tangents [-edge, edge].
void sample_range(double coordinate, double depth, double radius, double edge, int count, int& from, int& to) {
  double low = -edge, high = edge;
  tangent_interval(coordinate, depth, radius, low, high);
  const auto sample = [&](double tangent) { return (std::clamp(tangent / edge, -1.0, 1.0) + 1) / 2 * count; };
  from = static_cast<int>(std::floor(sample(low)));
  to = static_cast<int>(std::ceil(sample(high)));
}

}  // namespace

glm::dvec3 sample_direction(const Pose& world_from_camera, const Lens& lens, double x, double y, int columns,
                            int rows) {
  const double half_height = std::tan(lens.vertical_fov_rad / 2);
  return world_from_camera.rotation *
         glm::dvec3((2 * x / columns - 1) * half_height * lens.aspect, (2 * y / rows - 1) * half_height, -1.0);
}

PixelBox sphere_pixels(const Pose& world_from_camera, const Lens& lens, const glm::dvec3& center_m, double radius_m,
                       int columns, int rows) {
  const glm::dvec3 p = inverse_transform_point(world_from_camera, center_m);
  if (-p.z + radius_m <= 0) return {};
  const double half_height = std::tan(lens.vertical_fov_rad / 2);
  PixelBox box;
  sample_range(p.x, -p.z, radius_m, half_height * lens.aspect, columns, box.x0, box.x1);
  sample_range(p.y, -p.z, radius_m, half_height, rows, box.y0, box.y1);
  return box.x0 < box.x1 && box.y0 < box.y1 ? box : PixelBox{};
}

PictureTruth measure_picture(const EmbreeScene& occluders, const SceneMirror& mirror, std::span<const Target> targets,
                             const Pose& world_from_camera, const Lens& lens, int size) {
  const Eye eye{world_from_camera, lens, size};
  PictureTruth picture;
  for (const Target& target : targets) picture.targets.push_back(TargetLook(occluders, mirror, target, eye).take());
  return picture;
}

void add_outlines(const EmbreeScene& occluders, const SceneMirror& mirror, std::span<const Target> targets,
                  const Pose& world_from_camera, const Lens& lens, PictureTruth& picture) {
  for (size_t i = 0; i < targets.size(); ++i)
    if (picture.targets[i].alone_pixels > 0)
      picture.targets[i].outline = measure_outline(occluders, mirror.instances(), body_slots(mirror, targets[i]),
                                                   world_from_camera, lens);
}

bool PictureTruth::fully_hidden() const {
  return !targets.empty() && std::all_of(targets.begin(), targets.end(),
                                         [](const TargetTruth& target) { return target.visible_pixels == 0; });
}

bool PictureTruth::partly_hidden(double tolerance) const {
  return !fully_hidden() && std::any_of(targets.begin(), targets.end(), [&](const TargetTruth& target) {
    return target.visible_share() < 1.0 - tolerance;
  });
}

bool PictureTruth::all_seen() const {
  return std::all_of(targets.begin(), targets.end(),
                     [](const TargetTruth& target) { return target.visible_pixels > 0; });
}

double PictureTruth::least_whole_share() const {
  double least = 1.0;
  for (const TargetTruth& target : targets) least = std::min(least, target.whole_share());
  return least;
}

bool PictureTruth::all_whole() const {
  return std::all_of(targets.begin(), targets.end(), [](const TargetTruth& target) { return target.shown_whole(); });
}

BodyTruth measure_body(const EmbreeScene& colliders, const glm::dvec3& before_m, const glm::dvec3& now_m) {
  BodyTruth body;
  body.clearance_m = colliders.nearest_surface_m(now_m, BodyTruth::kReachM);
  const glm::dvec3 way = now_m - before_m;
  if (glm::length(way) > 0) body.crossed = colliders.is_blocked(before_m, glm::vec3(way), 0.0f, 1.0f);
  return body;
}

}  // namespace sightline
