#include "server/sample/cull.h"

#include <algorithm>
#include <cmath>

namespace sightline {
namespace {

// One row of the projection with what interval arithmetic over a box needs. The slack covers the rounding of positions
// and rows to single precision.
struct Row {
  glm::vec3 slope, absolute;
  float offset, slack;

  Row(const glm::vec4& row, float reach)
      : slope(row), absolute(glm::abs(slope)), offset(row.w),
        slack(1e-6f * (glm::length(slope) * reach + std::abs(row.w))) {}
};
struct Interval {
  float low, high;
};
Interval over_box(const Row& row, const glm::vec3& center, const glm::vec3& half) {
  const float middle = glm::dot(row.slope, center) + row.offset;
  const float reach = glm::dot(row.absolute, half) + row.slack;
  return {middle - reach, middle + reach};
}

float reach_of(const Aabb& box) {
  const glm::vec3 far = glm::max(glm::abs(box.min), glm::abs(box.max));
  return glm::length(far);
}

// The whole numbers in [0, count) that a quotient numerator / depth may come within the margin of.
struct SampleRange {
  int first = 0, last = -1;
  bool empty() const { return last < first; }
};
SampleRange samples_met(const Interval& numerator, const Interval& depth, int count) {
  constexpr float kMargin = static_cast<float>(kFrustumMarginTexels);
  const float low = numerator.low / (numerator.low < 0 ? depth.low : depth.high) - kMargin;
  const float high = numerator.high / (numerator.high < 0 ? depth.high : depth.low) + kMargin;
  const float end = static_cast<float>(count - 1);
  if (!(high >= 0 && low <= end)) return {};
  return {static_cast<int>(std::ceil(std::max(low, 0.0f))), static_cast<int>(std::floor(std::min(high, end)))};
}

class BoxTest {
 public:
  BoxTest(const SampleGrid& grid, float reach)
      : x_(grid.x, reach), y_(grid.y, reach), w_(grid.w, reach), grid_(grid) {}

  // False when no sample can show the box. Fills in where it can and how near it can be.
  bool may_show(const Aabb& box, VisibleCluster& where) const {
    const glm::vec3 center = box.center(), half = box.half_extent();
    const Interval depth = over_box(w_, center, half);
    if (depth.high < grid_.near_m) return false;
    SampleRange x{0, grid_.width - 1}, y{0, grid_.height - 1};
    // A box that reaches behind the near plane has no bounded projection.
    if (depth.low >= 0.5f * grid_.near_m) {
      x = samples_met(over_box(x_, center, half), depth, grid_.width);
      y = samples_met(over_box(y_, center, half), depth, grid_.height);
    }
    where.near_depth_m = std::max(depth.low, grid_.near_m);
    where.x0 = static_cast<uint8_t>(x.first), where.x1 = static_cast<uint8_t>(x.last);
    where.y0 = static_cast<uint8_t>(y.first), where.y1 = static_cast<uint8_t>(y.last);
    return !x.empty() && !y.empty();
  }

 private:
  const Row x_, y_, w_;
  const SampleGrid& grid_;
};

// Corners of one triangle in the coordinates of a SampleGrid.
struct ProjectedTriangle {
  std::array<float, 3> x, y, w;
};

ProjectedTriangle project_corners(const Geometry& geometry, uint32_t first_index, const SampleGrid& grid) {
  ProjectedTriangle out;
  for (uint32_t k = 0; k < 3; ++k) {
    const glm::vec3& p = geometry.positions[geometry.indices[first_index + k]];
    out.x[k] = grid.x.x * p.x + grid.x.y * p.y + grid.x.z * p.z + grid.x.w;
    out.y[k] = grid.y.x * p.x + grid.y.y * p.y + grid.y.z * p.z + grid.y.w;
    out.w[k] = grid.w.x * p.x + grid.w.y * p.y + grid.w.z * p.z + grid.w.w;
  }
  return out;
}

float least(const std::array<float, 3>& v) {
  return std::min(v[0], std::min(v[1], v[2]));
}
float greatest(const std::array<float, 3>& v) {
  return std::max(v[0], std::max(v[1], v[2]));
}

// The samples between the least and the greatest of three quotients, `slack` being their rounding.
SampleRange samples_between(const std::array<float, 3>& q, float slack, int count) {
  return samples_met({least(q) - slack, greatest(q) + slack}, {1.0f, 1.0f}, count);
}

// Drops single triangles. One object serves a cluster.
class TriangleTest {
 public:
  TriangleTest(const SampleGrid& grid, const Aabb& bounds)
      : grid_(grid), slack_x_(Row(grid.x, reach_of(bounds)).slack), slack_y_(Row(grid.y, reach_of(bounds)).slack),
        slack_w_(Row(grid.w, reach_of(bounds)).slack) {}

  bool may_show(const Geometry& geometry, uint32_t first_index, const float* depth_m) const {
    ProjectedTriangle t = project_corners(geometry, first_index, grid_);
    if (greatest(t.w) + slack_w_ < grid_.near_m) return false;
    const float nearest = least(t.w) - slack_w_;
    // A triangle that reaches behind the near plane has no bounded projection.
    if (nearest < 0.5f * grid_.near_m) return true;
    const float inverse_nearest = 1.0f / nearest;
    for (int k = 0; k < 3; ++k) {
      const float inverse = 1.0f / t.w[k];
      t.x[k] *= inverse;
      t.y[k] *= inverse;
    }
    const SampleRange x = samples_between(t.x, slack_in_samples(t.x, slack_x_, inverse_nearest), grid_.width);
    if (x.empty()) return false;
    const SampleRange y = samples_between(t.y, slack_in_samples(t.y, slack_y_, inverse_nearest), grid_.height);
    if (y.empty()) return false;
    const VisibleCluster where{0, 0, std::max(nearest, grid_.near_m), static_cast<uint8_t>(x.first),
                               static_cast<uint8_t>(x.last), static_cast<uint8_t>(y.first),
                               static_cast<uint8_t>(y.last)};
    return !is_hidden(where, depth_m, grid_.width);
  }

 private:
  // Of numerator / depth: what the rounding of both can move the quotient by.
  float slack_in_samples(const std::array<float, 3>& q, float slack, float inverse_nearest) const {
    return (slack + std::max(std::abs(least(q)), std::abs(greatest(q))) * slack_w_) * inverse_nearest;
  }

  const SampleGrid& grid_;
  const float slack_x_, slack_y_, slack_w_;
};

// Rasterisers order surfaces in single precision: one so little nearer does not hide for certain.
constexpr float kHidingMargin = 1e-3f;

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

bool sphere_is_outside(const Frustum& frustum, const glm::dvec3& center_m, double radius_m) {
  for (const glm::dvec4& plane : frustum.planes)
    if (glm::dot(glm::dvec3(plane), center_m) + plane.w < -radius_m) return true;
  return false;
}

SampleGrid sample_grid(const glm::dvec4& clip_x, const glm::dvec4& clip_y, const glm::dvec4& clip_w,
                       const MapView& view) {
  const double half_width = 0.5 * view.width, half_height = 0.5 * view.height;
  return {glm::vec4(half_width * clip_x + (half_width - 0.5) * clip_w),
          glm::vec4(half_height * clip_y + (half_height - 0.5) * clip_w),
          glm::vec4(clip_w),
          static_cast<float>(view.near_m),
          view.width,
          view.height};
}

void append_visible_clusters(const TriangleTree& tree, const SampleGrid& grid, std::vector<VisibleCluster>& clusters) {
  if (tree.empty()) return;
  const BoxTest test(grid, reach_of(tree[0].bounds));
  // Depth first, left before right: one right child waits for each level.
  std::array<uint32_t, kMaxTreeDepth + 2> waiting;
  size_t count = 0;
  waiting[count++] = 0;
  while (count > 0) {
    const uint32_t index = waiting[--count];
    const TreeNode& node = tree[index];
    VisibleCluster cluster{.first_index = node.first_index, .index_count = node.index_count};
    if (!test.may_show(node.bounds, cluster)) continue;
    if (node.is_leaf()) {
      clusters.push_back(cluster);
    } else {
      waiting[count++] = node.right;
      waiting[count++] = index + 1;
    }
  }
}

bool is_hidden(const VisibleCluster& cluster, const float* depth_m, int width) {
  const float hiding_m = cluster.near_depth_m * (1.0f - kHidingMargin);
  for (int y = cluster.y0; y <= cluster.y1; ++y)
    for (int x = cluster.x0; x <= cluster.x1; ++x)
      if (!(depth_m[y * width + x] < hiding_m)) return false;
  return true;
}

void append_visible_triangles(const Geometry& geometry, const VisibleCluster& cluster, const SampleGrid& grid,
                              const float* depth_m, std::vector<uint32_t>& indices) {
  const TriangleTest test(grid, geometry.bounds);
  for (uint32_t i = cluster.first_index; i < cluster.first_index + cluster.index_count; i += 3)
    if (test.may_show(geometry, i, depth_m)) indices.insert(indices.end(), {i, i + 1, i + 2});
}

}  // namespace sightline
