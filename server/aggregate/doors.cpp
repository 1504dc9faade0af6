#include "server/aggregate/doors.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace sightline {
namespace {

constexpr double kThin = 0.25;       // the box's least side over its greatest
constexpr double kRestM = 0.02;      // moves by less at rest
constexpr double kRestS = 0.5;       // what has rested for so long is shut
constexpr double kAsideSizes = 1.2;  // an open door is at most so many of its widths or heights from where it shuts
constexpr double kForgetS = 6.0;     // time constant
constexpr double kLeastWeight = 0.05;

// Along the plate's normal, and along its two axes in halves of the plate.
struct PlateFrame {
  explicit PlateFrame(const Plate& plate)
      : normal(glm::normalize(glm::cross(plate.half_u_m, plate.half_v_m))),
        u(plate.half_u_m / glm::dot(plate.half_u_m, plate.half_u_m)),
        v(plate.half_v_m / glm::dot(plate.half_v_m, plate.half_v_m)) {}
  glm::dvec3 normal, u, v;
};

}  // namespace

bool plate_of(const Instance& instance, Plate& plate) {
  if (!instance.geometry) return false;
  const Aabb& box = instance.geometry->bounds;
  const glm::dvec3 half_m(box.half_extent());
  std::array<glm::dvec3, 3> sides;
  for (int k = 0; k < 3; ++k) sides[static_cast<size_t>(k)] = instance.world_from_instance[k] * half_m[k];
  std::ranges::sort(sides, std::greater<>(), [](const glm::dvec3& side) { return glm::dot(side, side); });
  if (!(glm::length(sides[2]) <= kThin * glm::length(sides[0])) || !(glm::length(sides[1]) > 1e-3)) return false;
  plate = {transform_point(instance.world_from_instance, glm::dvec3(box.center())), sides[0], sides[1]};
  return true;
}

void Doors::pass(const SceneMirror& scene, std::span<const uint64_t> target_ids, double dt_s, double clock_s) {
  const auto may_be_door = [&](const Instance& instance) {
    return instance.occludes() && instance.collides() && std::ranges::find(target_ids, instance.id) == target_ids.end();
  };
  const size_t known = leaves_.size();
  size_t there = 0;
  for (const uint32_t slot : scene.moving_slots()) {
    const Instance& instance = scene.instances()[slot];
    Plate now;
    if (!may_be_door(instance) || !plate_of(instance, now)) continue;
    const std::span<Leaf> sorted(leaves_.data(), known);
    const auto leaf = std::ranges::lower_bound(sorted, instance.id, {}, &Leaf::id);
    if (leaf != sorted.end() && leaf->id == instance.id)
      ++there, follow(*leaf, now, dt_s);
    else  // It moves for the first time, so it has rested so far.
      leaves_.push_back({.id = instance.id, .rest = now, .rested_s = clock_s});
  }
  if (there < known)
    std::erase_if(leaves_, [&](const Leaf& leaf) {
      const Instance* instance = scene.find(leaf.id);
      return !instance || !may_be_door(*instance);
    });
  if (leaves_.size() > known || there < known) std::ranges::sort(leaves_, {}, &Leaf::id);
}

void Doors::follow(Leaf& leaf, const Plate& now, double dt_s) {
  const double away_m = glm::distance(now.middle_m, leaf.rest.middle_m);
  if (away_m < kRestM) {
    leaf.rested_s += dt_s, leaf.away_s = 0.0;
    return;
  }
  const double size_m = 2 * std::max(glm::length(leaf.rest.half_u_m), glm::length(leaf.rest.half_v_m));
  if (leaf.rested_s >= kRestS && away_m <= kAsideSizes * size_m)
    leaf.away_s += dt_s;
  else
    leaf.rest = now, leaf.rested_s = leaf.away_s = 0.0;
}

OpenDoors Doors::open(const glm::dvec3& center_m, double radius_m, const glm::dvec3& to_m) const {
  const glm::dvec3 middle_m = (center_m + to_m) / 2.0;
  const double reach_m = glm::distance(center_m, to_m) / 2 + radius_m;
  const auto away_m = [&](const OpenDoor& door) { return glm::distance(center_m, door.shut.middle_m); };
  OpenDoors open;
  for (const Leaf& leaf : leaves_) {
    const double weight = leaf.away_s > 0 ? std::exp(-leaf.away_s / kForgetS) : 0.0;
    if (weight < kLeastWeight) continue;
    const double size_m = glm::length(leaf.rest.half_u_m) + glm::length(leaf.rest.half_v_m);
    if (glm::distance(middle_m, leaf.rest.middle_m) > reach_m + size_m) continue;
    const OpenDoor door{leaf.rest, static_cast<float>(weight)};
    if (open.size() < kMostOpenDoors) {
      open.push_back(door);
      continue;
    }
    const auto farthest = std::ranges::max_element(open, {}, away_m);
    if (away_m(door) < away_m(*farthest)) *farthest = door;
  }
  return open;
}

void hide_behind(const OpenDoor& door, const Places& places, const glm::dvec3& to_m, std::span<float> hidden) {
  const PlateFrame frame(door.shut);
  const glm::vec3 n(frame.normal), u(frame.u), v(frame.v), from(door.shut.middle_m - places.origin_m),
      to(to_m - door.shut.middle_m);
  const float to_n = glm::dot(n, to), to_u = glm::dot(u, to), to_v = glm::dot(v, to);
  for (size_t i = 0; i < hidden.size(); ++i) {
    const float x = places.x_m[i] - from.x, y = places.y_m[i] - from.y, z = places.z_m[i] - from.z;
    const float along = n.x * x + n.y * y + n.z * z, side_u = u.x * x + u.y * y + u.z * z,
                side_v = v.x * x + v.y * y + v.z * z;
    // Where the line crosses the plate's plane, as a share of the way from the place; a line along it crosses nowhere.
    const float share = along / (along - to_n);
    const float at_u = side_u + share * (to_u - side_u), at_v = side_v + share * (to_v - side_v);
    const bool is_hidden = (along * to_n < 0.0f) & (std::abs(at_u) <= 1.0f) & (std::abs(at_v) <= 1.0f);
    hidden[i] = is_hidden ? std::max(hidden[i], door.weight) : hidden[i];
  }
}

}  // namespace sightline
