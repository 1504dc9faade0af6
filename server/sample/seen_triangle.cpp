#include "server/sample/seen_triangle.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace sightline {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
// How far from the rasterised depth a neighbouring triangle may lie, relative.
constexpr double kNeighbourReach = 0.02;

struct Hit {
  double depth = kInfinity;  // where the ray meets the plane
  bool inside = false;       // of the triangle
};

// Moeller & Trumbore, "Fast, minimum storage ray/triangle intersection", 1997; the origin of the ray is 0.
Hit intersect(const std::array<glm::dvec3, 3>& corner, const glm::dvec3& direction) {
  const glm::dvec3 ab = corner[1] - corner[0], ac = corner[2] - corner[0];
  const glm::dvec3 p = glm::cross(direction, ac), q = glm::cross(ab, corner[0]);
  const double det = glm::dot(ab, p);
  if (det == 0.0) return {};
  const double u = -glm::dot(corner[0], p) / det, v = glm::dot(direction, q) / det;
  return {glm::dot(ac, q) / det, u >= 0 && v >= 0 && u + v <= 1};
}

// Finds the nearest of a geometry's occluding triangles along a ray, in the geometry's frame.
class GeometryRay {
 public:
  GeometryRay(const Geometry& geometry, const glm::dvec3& origin, const glm::dvec3& direction)
      : geometry_(geometry), origin_(origin), direction_(direction) {
    // Finite for a ray along a slab, so that none of the products below is 0 * infinity.
    for (int axis = 0; axis < 3; ++axis) inverse_[axis] = direction[axis] != 0.0 ? 1.0 / direction[axis] : 1e300;
  }

  // Its depth, when between `low` and `high`; else infinity.
  double nearest_between(double low, double high) {
    low_ = low, high_ = high, nearest_ = kInfinity;
    if (!geometry_.occluding.empty()) visit(0);
    return nearest_;
  }

 private:
  void visit(uint32_t index) {
    const TreeNode& node = geometry_.occluding[index];
    if (!meets(node.bounds)) return;
    if (node.is_leaf()) return visit_triangles(node);
    visit(index + 1);
    visit(node.right);
  }

  void visit_triangles(const TreeNode& node) {
    const auto corner = [&](uint32_t i) { return glm::dvec3(geometry_.positions[geometry_.indices[i]]) - origin_; };
    for (uint32_t i = node.first_index; i < node.first_index + node.index_count; i += 3) {
      const Hit hit = intersect({corner(i), corner(i + 1), corner(i + 2)}, direction_);
      if (hit.inside && hit.depth >= low_ && hit.depth <= high_) nearest_ = std::min(nearest_, hit.depth);
    }
  }

  bool meets(const Aabb& box) const {
    double enter = low_, leave = std::min(high_, nearest_);
    for (int axis = 0; axis < 3; ++axis) {
      const double a = (box.min[axis] - origin_[axis]) * inverse_[axis],
                   b = (box.max[axis] - origin_[axis]) * inverse_[axis];
      enter = std::max(enter, std::min(a, b));
      leave = std::min(leave, std::max(a, b));
    }
    return enter <= leave;
  }

  const Geometry& geometry_;
  const glm::dvec3 origin_, direction_;
  glm::dvec3 inverse_;
  double low_ = 0.0, high_ = 0.0, nearest_ = kInfinity;
};

}  // namespace

SeenTriangle::SeenTriangle(const MapView& view, const Instance& instance, double ahead_s, uint32_t vertex)
    : view_(&view), instance_(&instance), ahead_s_(ahead_s), nearest_(kInfinity), farthest_(view.near_m) {
  const Geometry& geometry = *instance.geometry;
  const Affine world_from_instance = world_from_instance_ahead(instance, ahead_s);
  const uint32_t first = vertex / 3 * 3;
  for (uint32_t k = 0; k < 3; ++k) {
    const glm::dvec3 position(geometry.positions[geometry.indices[first + k]]);
    corner_[k] = transform_point(world_from_instance, position) - view.eye_m;
    const double depth = -glm::dot(view.world_from_view[2], corner_[k]);
    nearest_ = std::min(nearest_, depth);
    farthest_ = std::max(farthest_, depth);
  }
  nearest_ = std::max(nearest_, view.near_m);
}

double SeenTriangle::depth_along(const glm::dvec3& direction) const {
  const Hit hit = intersect(corner_, direction);
  if (hit.inside) return hit.depth;
  const double about = std::clamp(std::isfinite(hit.depth) ? hit.depth : nearest_, nearest_, farthest_);
  const Affine from_world = inverse(world_from_instance_ahead(*instance_, ahead_s_));
  GeometryRay ray(*instance_->geometry, transform_point(from_world, view_->eye_m),
                  transform_vector(from_world, direction));
  const double met = ray.nearest_between(std::max(view_->near_m, about * (1 - kNeighbourReach)),
                                         about * (1 + kNeighbourReach));
  return std::isfinite(met) ? met : about;
}

}  // namespace sightline
