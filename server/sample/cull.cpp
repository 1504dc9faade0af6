#include "server/sample/cull.h"

#include <algorithm>
#include <cmath>

namespace sightline {
namespace {

enum class Side { kOutside, kAcross, kInside };

// A plane with the absolute value of its normal, in single precision with slack for the rounding of both.
struct BoxPlane {
  glm::vec3 normal, absolute;
  float offset, slack;
};
using BoxPlanes = std::array<BoxPlane, 5>;

// The slack covers rounding on boxes about `reach` from the origin of the frame.
BoxPlanes box_planes(const Frustum& frustum, float reach) {
  BoxPlanes out;
  for (size_t i = 0; i < out.size(); ++i) {
    const glm::vec3 normal(frustum.planes[i]);
    const float offset = static_cast<float>(frustum.planes[i].w);
    out[i] = {normal, glm::abs(normal), offset, 1e-6f * (glm::length(normal) * reach + std::abs(offset))};
  }
  return out;
}

Side side_of(const BoxPlanes& planes, const Aabb& box) {
  const glm::vec3 center = box.center(), half = box.half_extent();
  Side side = Side::kInside;
  for (const BoxPlane& plane : planes) {
    const float distance = glm::dot(plane.normal, center) + plane.offset;
    const float reach = glm::dot(plane.absolute, half) + plane.slack;
    if (distance < -reach) return Side::kOutside;
    if (distance < reach) side = Side::kAcross;
  }
  return side;
}

void append_range(const TreeNode& node, uint32_t bridge_indices, size_t begin, std::vector<IndexRange>& ranges) {
  if (ranges.size() > begin) {
    IndexRange& last = ranges.back();
    if (node.first_index - (last.first_index + last.index_count) <= bridge_indices) {
      last.index_count = node.first_index + node.index_count - last.first_index;
      return;
    }
  }
  ranges.push_back({node.first_index, node.index_count});
}

float reach_of(const Aabb& box) {
  const glm::vec3 far = glm::max(glm::abs(box.min), glm::abs(box.max));
  return glm::length(far);
}

}  // namespace

Frustum sample_frustum(const MapView& view) {
  // Slopes of the outermost sample points, then a margin outside them.
  const double dx = (view.right - view.left) / view.width, dy = (view.top - view.bottom) / view.height;
  const double left = view.left + (view.jitter.x - kFrustumMarginTexels) * dx;
  const double right = view.right - (1.0 - view.jitter.x - kFrustumMarginTexels) * dx;
  const double bottom = view.bottom + (view.jitter.y - kFrustumMarginTexels) * dy;
  const double top = view.top - (1.0 - view.jitter.y - kFrustumMarginTexels) * dy;
  const std::array<glm::dvec4, 5> in_view{{{0, 0, -1, -view.near_m},
                                           {1, 0, left, 0},
                                           {-1, 0, -right, 0},
                                           {0, 1, bottom, 0},
                                           {0, -1, -top, 0}}};
  Frustum out;
  for (size_t i = 0; i < in_view.size(); ++i) {
    const double scale = 1.0 / glm::length(glm::dvec3(in_view[i]));
    const glm::dvec3 normal = view.world_from_view * (glm::dvec3(in_view[i]) * scale);
    out.planes[i] = {normal, in_view[i].w * scale - glm::dot(normal, view.eye_m)};
  }
  return out;
}

Frustum to_local(const Frustum& frustum, const Affine& world_from_local) {
  Frustum out;
  for (size_t i = 0; i < out.planes.size(); ++i) {
    const glm::dvec3 normal(frustum.planes[i]);
    out.planes[i] = {glm::dot(normal, world_from_local[0]), glm::dot(normal, world_from_local[1]),
                     glm::dot(normal, world_from_local[2]),
                     glm::dot(normal, world_from_local[3]) + frustum.planes[i].w};
  }
  return out;
}

bool sphere_is_outside(const Frustum& frustum, const glm::dvec3& center_m, double radius_m) {
  for (const glm::dvec4& plane : frustum.planes)
    if (glm::dot(glm::dvec3(plane), center_m) + plane.w < -radius_m) return true;
  return false;
}

void append_visible_ranges(const TriangleTree& tree, const Frustum& local, uint32_t bridge_indices,
                           std::vector<IndexRange>& ranges) {
  if (tree.empty()) return;
  const BoxPlanes planes = box_planes(local, reach_of(tree[0].bounds));
  const size_t begin = ranges.size();
  // Depth first, left before right: ranges come in order. One right child waits for each level.
  std::array<uint32_t, kMaxTreeDepth + 2> waiting;
  size_t count = 0;
  waiting[count++] = 0;
  while (count > 0) {
    const uint32_t index = waiting[--count];
    const TreeNode& node = tree[index];
    const Side side = side_of(planes, node.bounds);
    if (side == Side::kOutside) continue;
    if (side == Side::kInside || node.is_leaf()) {
      append_range(node, bridge_indices, begin, ranges);
    } else {
      waiting[count++] = node.right;
      waiting[count++] = index + 1;
    }
  }
}

}  // namespace sightline
