#include "tests/sample/brute_force.h"

#include <algorithm>

namespace sightline::test {

double hit_distance(const Triangle& triangle, const glm::dvec3& origin, const glm::dvec3& direction) {
  const glm::dvec3 ab = triangle.b - triangle.a, ac = triangle.c - triangle.a;
  const glm::dvec3 p = glm::cross(direction, ac);
  const double det = glm::dot(ab, p);
  if (det == 0.0) return kInfinity;
  const glm::dvec3 s = origin - triangle.a;
  const double u = glm::dot(s, p) / det;
  const glm::dvec3 q = glm::cross(s, ab);
  const double v = glm::dot(direction, q) / det;
  if (u < 0 || v < 0 || u + v > 1) return kInfinity;
  return glm::dot(ac, q) / det;
}

BruteHit brute_trace(const SceneMirror& mirror, bool occluders, const glm::dvec3& origin, const glm::dvec3& direction,
                     double near, const RayFilter& filter) {
  BruteHit best;
  for (uint32_t slot = 0; slot < mirror.instances().size(); ++slot) {
    const Instance& instance = mirror.instances()[slot];
    if (!instance.geometry || !(occluders ? instance.occludes() : instance.collides())) continue;
    if ((instance.attributes.layers & filter.layer_mask) == 0) continue;
    if (std::ranges::count(filter.ignored_slots, slot) > 0) continue;
    if (filter.only_slot != UINT32_MAX && filter.only_slot != slot) continue;
    double nearest = kInfinity;
    for_each_triangle(instance, occluders, [&](const Triangle& triangle) {
      const double distance = hit_distance(triangle, origin, direction);
      if (distance > near && distance < nearest) nearest = distance;
    });
    if (nearest < best.distance)
      best = {nearest, best.distance, slot};
    else
      best.second = std::min(best.second, nearest);
  }
  return best;
}

}  // namespace sightline::test
