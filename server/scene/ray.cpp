#include "server/scene/ray.h"

#include <algorithm>
#include <cassert>

#include "server/scene/box_ray.h"
#include "server/scene/crossings.h"

namespace sightline {
namespace {

constexpr float kMiss = std::numeric_limits<float>::infinity();

// Crossings from this part of the line on do not count.
constexpr double kBeforeEnd = 1.0 - 1e-6;

}  // namespace

struct RayCaster::Ray : BoxRay {
  glm::vec3 from_center, direction;  // what triangles are tested with
};

struct RayCaster::Nearest {
  float distance = kMiss;
  size_t triangle = 0;
};

RayCaster::RayCaster(const Geometry& geometry) : geometry_(geometry) {
  for (std::vector<float>& row : rows_) row.reserve(geometry.triangle_count());
  const auto corner = [&](size_t i) { return glm::dvec3(geometry.positions[geometry.indices[i]]); };
  for (size_t i = 0; i < geometry.indices.size(); i += 3) {
    const glm::dvec3 a = corner(i);
    const glm::vec3 from_center(a - glm::dvec3(geometry.center)), ab(corner(i + 1) - a), ac(corner(i + 2) - a);
    for (int axis = 0; axis < 3; ++axis) {
      rows_[axis].push_back(from_center[axis]);
      rows_[3 + axis].push_back(ab[axis]);
      rows_[6 + axis].push_back(ac[axis]);
    }
  }
}

SurfaceHit RayCaster::first_hit(const glm::dvec3& origin_m, const glm::dvec3& direction) const {
  assert(glm::dot(direction, direction) > 0);
  const Ray ray{{origin_m, direction}, glm::vec3(origin_m - glm::dvec3(geometry_.center)), glm::vec3(direction)};
  Nearest nearest;
  search(geometry_.occluding, ray, nearest);
  search(geometry_.see_through, ray, nearest);
  if (nearest.distance == kMiss) return {};

  return exactly(origin_m, direction, nearest);
}

// The point in double on the triangle's own plane, held inside the triangle.
SurfaceHit RayCaster::exactly(const glm::dvec3& origin_m, const glm::dvec3& direction, const Nearest& nearest) const {
  const uint32_t* corner = geometry_.indices.data() + 3 * nearest.triangle;
  const glm::dvec3 a(geometry_.positions[corner[0]]), ab = glm::dvec3(geometry_.positions[corner[1]]) - a,
                                                      ac = glm::dvec3(geometry_.positions[corner[2]]) - a;
  const glm::dvec3 p = glm::cross(direction, ac), s = origin_m - a, q = glm::cross(s, ab);
  const double det = glm::dot(ab, p);
  const auto first_index = static_cast<uint32_t>(3 * nearest.triangle);
  if (det == 0.0) return {nearest.distance, origin_m + direction * double{nearest.distance}, first_index};
  const double u = std::clamp(glm::dot(s, p) / det, 0.0, 1.0);
  const double v = std::clamp(glm::dot(direction, q) / det, 0.0, 1.0 - u);
  const glm::dvec3 point = a + ab * u + ac * v;
  const double distance = glm::dot(point - origin_m, direction) / glm::dot(direction, direction);
  return {std::max(distance, 0.0), point, first_index};
}

void RayCaster::search(const TriangleTree& tree, const Ray& ray, Nearest& nearest) const {
  struct Entry {
    uint32_t node;
    double distance;
  };
  if (tree.empty()) return;
  std::array<Entry, kMaxTreeDepth + 1> stack;
  size_t depth = 0;
  stack[depth++] = {0, ray.enters(tree[0].bounds)};
  while (depth > 0) {
    const Entry entry = stack[--depth];
    if (!(entry.distance < nearest.distance)) continue;
    const TreeNode& node = tree[entry.node];
    if (node.is_leaf()) {
      test_cluster(node, ray, nearest);
      continue;
    }
    Entry near{entry.node + 1, ray.enters(tree[entry.node + 1].bounds)},
        far{node.right, ray.enters(tree[node.right].bounds)};
    if (far.distance < near.distance) std::swap(near, far);
    assert(depth + 2 <= stack.size());
    if (far.distance < nearest.distance) stack[depth++] = far;
    if (near.distance < nearest.distance) stack[depth++] = near;
  }
}

// Two loops, the first without branches, so that the compiler tests several triangles at once.
void RayCaster::test_cluster(const TreeNode& leaf, const Ray& ray, Nearest& nearest) const {
  const size_t first = leaf.first_index / 3, count = leaf.index_count / 3;
  assert(count <= kMaxClusterTriangles);
  std::array<float, kMaxClusterTriangles> distances;
  const auto row = [&](int i) { return rows_[i].data() + first; };
  const float *ax = row(0), *ay = row(1), *az = row(2), *bx = row(3), *by = row(4), *bz = row(5), *cx = row(6),
              *cy = row(7), *cz = row(8);
  const float dx = ray.direction.x, dy = ray.direction.y, dz = ray.direction.z;
  const float ox = ray.from_center.x, oy = ray.from_center.y, oz = ray.from_center.z;
  for (size_t i = 0; i < count; ++i) {
    const float px = dy * cz[i] - dz * cy[i], py = dz * cx[i] - dx * cz[i], pz = dx * cy[i] - dy * cx[i];
    const float inverse_det = 1.0f / (bx[i] * px + by[i] * py + bz[i] * pz);
    const float sx = ox - ax[i], sy = oy - ay[i], sz = oz - az[i];
    const float qx = sy * bz[i] - sz * by[i], qy = sz * bx[i] - sx * bz[i], qz = sx * by[i] - sy * bx[i];
    const float u = (sx * px + sy * py + sz * pz) * inverse_det;
    const float v = (dx * qx + dy * qy + dz * qz) * inverse_det;
    const float t = (cx[i] * qx + cy[i] * qy + cz[i] * qz) * inverse_det;
    // For a triangle seen edge-on these are not numbers, or infinite: no hit.
    const bool inside = (u >= 0.0f) & (v >= 0.0f) & (u + v <= 1.0f) & (t >= 0.0f);
    distances[i] = inside ? t : kMiss;
  }
  for (size_t i = 0; i < count; ++i)
    if (distances[i] < nearest.distance) nearest = {distances[i], first + i};
}

bool crosses(const Geometry& geometry, const glm::dvec3& from_m, const glm::dvec3& to_m) {
  bool crossed = false;
  visit_crossings(geometry, from_m, to_m - from_m, kBeforeEnd, [&](const Crossing&) {
    crossed = true;
    return false;
  });
  return crossed;
}

}  // namespace sightline
