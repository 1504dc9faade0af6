#include "client/truth/outline.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace sightline {
namespace {

// A cone of directions in the world.
struct Cone {
  glm::dvec3 axis{0, 0, -1};
  double cos_half = -1.0;  // -1: all directions
};

// About the bounding spheres of the body. An eye within one of them needs all directions.
Cone cone_around(std::span<const Instance> instances, std::span<const uint32_t> body_slots, const glm::dvec3& eye_m) {
  glm::dvec3 towards(0.0);
  for (const uint32_t slot : body_slots) towards += instances[slot].center_m - eye_m;
  if (glm::length(towards) < 1e-9) return {};
  Cone cone{.axis = glm::normalize(towards)};
  double half_rad = 0;
  for (const uint32_t slot : body_slots) {
    const glm::dvec3 out_m = instances[slot].center_m - eye_m;
    const double distance_m = glm::length(out_m), radius_m = instances[slot].radius_m;
    if (distance_m <= radius_m) return {};
    const double off_axis_rad = std::acos(std::clamp(glm::dot(out_m, cone.axis) / distance_m, -1.0, 1.0));
    half_rad = std::max(half_rad, off_axis_rad + std::asin(radius_m / distance_m));
  }
  cone.cos_half = std::cos(std::min(half_rad, std::numbers::pi));
  return cone;
}

// The k-th of kOutlineRays directions on a spiral that covers the cone evenly.
glm::dvec3 spiral_direction(const Cone& cone, const glm::dvec3& right, const glm::dvec3& up, int k) {
  const double along = 1 - (k + 0.5) / kOutlineRays * (1 - cone.cos_half);
  const double out = std::sqrt(std::max(0.0, 1 - along * along)),
               turn_rad = k * std::numbers::pi * (3 - std::sqrt(5.0));
  return along * cone.axis + out * (std::cos(turn_rad) * right + std::sin(turn_rad) * up);
}

}  // namespace

Outline measure_outline(const EmbreeScene& scene, std::span<const Instance> instances,
                        std::span<const uint32_t> body_slots, const Pose& world_from_camera, const Lens& lens) {
  const glm::dvec3 eye_m = world_from_camera.position_m;
  const Cone cone = cone_around(instances, body_slots, eye_m);
  const glm::dvec3 right = glm::normalize(
      glm::cross(cone.axis, std::abs(cone.axis.y) < 0.9 ? glm::dvec3(0, 1, 0) : glm::dvec3(1, 0, 0)));
  const glm::dvec3 up = glm::cross(right, cone.axis);
  const double half_height = std::tan(lens.vertical_fov_rad / 2), half_width = half_height * lens.aspect;
  double reach_m = 0, low = INFINITY, high = -INFINITY;
  for (const uint32_t slot : body_slots)
    reach_m = std::max(reach_m, 1.001 * (glm::distance(instances[slot].center_m, eye_m) + instances[slot].radius_m));
  const glm::dquat camera_from_world = glm::conjugate(world_from_camera.rotation);
  int hits = 0, inside = 0;
  for (int k = 0; k < kOutlineRays; ++k) {
    const glm::dvec3 direction = spiral_direction(cone, right, up, k);
    float nearest_m = INFINITY;
    for (const uint32_t slot : body_slots) {
      RayFilter alone;
      alone.only_slot = slot;
      nearest_m = std::min(
          nearest_m, scene.trace(eye_m, glm::vec3(direction), 0.0f, static_cast<float>(reach_m), alone).distance_m);
    }
    if (!(nearest_m <= reach_m)) continue;
    ++hits;
    const glm::dvec3 seen = camera_from_world * direction;
    if (seen.z >= 0) continue;
    const glm::dvec2 window(seen.x / -seen.z / half_width, seen.y / -seen.z / half_height);
    low = std::min(low, window.y), high = std::max(high, window.y);
    inside += std::abs(window.x) <= 1 && std::abs(window.y) <= 1 && -seen.z * nearest_m >= lens.near_m;
  }
  Outline outline;
  if (hits > 0) outline.in_picture_share = static_cast<double>(inside) / hits;
  if (high > low) outline.height_pictures = (high - low) / 2;
  return outline;
}

}  // namespace sightline
