#include "server/scene/crossings.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <optional>

#include "server/scene/box_ray.h"

namespace sightline {
namespace {

std::optional<Crossing> crossing_with(const Geometry& geometry, uint32_t first_index, const glm::dvec3& origin_m,
                                      const glm::dvec3& direction, double end) {
  const auto corner = [&](uint32_t k) { return glm::dvec3(geometry.positions[geometry.indices[first_index + k]]); };
  const glm::dvec3 a = corner(0), ab = corner(1) - a, ac = corner(2) - a;
  const glm::dvec3 p = glm::cross(direction, ac), s = origin_m - a, q = glm::cross(s, ab);
  const double det = glm::dot(ab, p), inverse_det = 1.0 / det;
  const double u = glm::dot(s, p) * inverse_det, v = glm::dot(direction, q) * inverse_det,
               t = glm::dot(ac, q) * inverse_det;
  // false for an edge-on triangle, where they are not numbers
  if (u >= 0 && v >= 0 && u + v <= 1 && t >= 0 && t < end) return Crossing{t, det < 0.0};
  return std::nullopt;
}

// False when `visit` has had enough.
bool visit_tree(const Geometry& geometry, const TriangleTree& tree, const glm::dvec3& origin_m,
                const glm::dvec3& direction, double end, const std::function<bool(const Crossing&)>& visit) {
  if (tree.empty()) return true;
  const BoxRay ray(origin_m, direction);
  std::array<uint32_t, kMaxTreeDepth + 1> stack;
  size_t depth = 0;
  stack[depth++] = 0;
  while (depth > 0) {
    const uint32_t at = stack[--depth];
    const TreeNode& node = tree[at];
    if (!(ray.enters(node.bounds) < end)) continue;
    if (!node.is_leaf()) {
      assert(depth + 2 <= stack.size());
      stack[depth++] = node.right, stack[depth++] = at + 1;
      continue;
    }
    for (uint32_t i = node.first_index; i < node.first_index + node.index_count; i += 3)
      if (const auto crossing = crossing_with(geometry, i, origin_m, direction, end); crossing && !visit(*crossing))
        return false;
  }
  return true;
}

}  // namespace

void visit_crossings(const Geometry& geometry, const glm::dvec3& origin_m, const glm::dvec3& direction, double end,
                     const std::function<bool(const Crossing&)>& visit) {
  if (visit_tree(geometry, geometry.occluding, origin_m, direction, end, visit))
    visit_tree(geometry, geometry.see_through, origin_m, direction, end, visit);
}

std::vector<Crossing> all_crossings(const Geometry& geometry, const glm::dvec3& origin_m, const glm::dvec3& direction) {
  std::vector<Crossing> all;
  visit_crossings(geometry, origin_m, direction, std::numeric_limits<double>::infinity(),
                  [&](const Crossing& crossing) { return all.push_back(crossing), true; });
  std::ranges::sort(all, {}, &Crossing::distance);
  return all;
}

}  // namespace sightline
