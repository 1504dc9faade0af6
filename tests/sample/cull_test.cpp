// Culling against brute force: no triangle that covers a sample point may be left out.
#include "server/sample/cull.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include "server/sample/draw_list.h"
#include "tests/sample/scene_maker.h"

namespace sightline {
namespace {

using test::SceneMaker;

bool inside(const Frustum& frustum, const glm::dvec3& p) {
  return std::ranges::all_of(frustum.planes,
                             [&](const glm::dvec4& plane) { return glm::dot(glm::dvec3(plane), p) + plane.w >= 0; });
}

// The depth along the view axis at which the ray of a sample meets a triangle; infinity when it does not, or before
// the near plane.
double depth_of(const MapView& view, int x, int y, const std::array<glm::dvec3, 3>& corner) {
  const glm::dvec3 d = texel_direction(view, x, y), ab = corner[1] - corner[0], ac = corner[2] - corner[0];
  const glm::dvec3 p = glm::cross(d, ac), s = view.eye_m - corner[0], q = glm::cross(s, ab);
  const double det = glm::dot(ab, p), u = glm::dot(s, p) / det, v = glm::dot(d, q) / det, t = glm::dot(ac, q) / det;
  return u >= 0 && v >= 0 && u + v <= 1 && t >= view.near_m ? t : std::numeric_limits<double>::infinity();
}

TEST(CullTest, EverySampleRayLiesInsideTheFrustumFromTheNearPlaneOn) {
  SceneMaker maker(1);
  for (int i = 0; i < 200; ++i) {
    const MapView view = maker.view();
    const Frustum frustum = sample_frustum(view);
    for (const double depth : {view.near_m * 1.0001, 1.0, 1e4})
      for (const auto& [x, y] : {std::pair(0, 0), {view.width - 1, 0}, {0, view.height - 1}, {view.width / 2, 1}})
        EXPECT_TRUE(inside(frustum, view.eye_m + depth * texel_direction(view, x, y)));
    EXPECT_FALSE(inside(frustum, view.eye_m + 0.5 * view.near_m * texel_direction(view, 0, 0)));
    EXPECT_FALSE(inside(frustum, view.eye_m + texel_direction(view, -1, 0)));
    EXPECT_FALSE(inside(frustum, view.eye_m + texel_direction(view, 0, view.height)));
  }
}

TEST(CullTest, ASphereThatHoldsAPointOfTheFrustumIsNeverOutside) {
  SceneMaker maker(2);
  int outside = 0;
  for (int i = 0; i < 300; ++i) {
    const MapView view = maker.view();
    const Frustum frustum = sample_frustum(view);
    const glm::dvec3 center = maker.pose().position_m;
    const double radius = maker.random().next_in(0.1, 2.0);
    if (!sphere_is_outside(frustum, center, radius)) continue;
    ++outside;
    for (int k = 0; k < 200; ++k) {
      const glm::dvec3 p = center + maker.random().next_in(0, radius) * (maker.pose().rotation * glm::dvec3(1, 0, 0));
      EXPECT_FALSE(inside(frustum, p));
    }
  }
  EXPECT_GT(outside, 100);
}

struct Case {
  SceneMirror mirror;
  MapView view;
  DrawList list;
};

// One instance in one map, seen through the whole path from mirror to draw list.
void make_case(uint64_t seed, Case& out) {
  SceneMaker maker(seed);
  SceneDelta delta;
  delta.add.push_back(maker.instance(1));
  delta.add[0].attributes = {};
  ASSERT_TRUE(out.mirror.apply(delta, {}));
  out.view = maker.view();
  OccluderTable table;
  table.take_in(out.mirror);
  table.append_map(out.mirror, {.view = out.view}, out.list);
}

std::array<glm::dvec3, 3> world_triangle(const Instance& instance, uint32_t first_index) {
  std::array<glm::dvec3, 3> corner;
  for (uint32_t k = 0; k < 3; ++k)
    corner[k] = transform_point(instance.world_from_instance,
                                glm::dvec3(instance.geometry->positions[instance.geometry->indices[first_index + k]]));
  return corner;
}

TEST(CullTest, ACulledClusterCoversNoSampleAndNoneIsDrawnTwice) {
  size_t culled = 0, kept = 0;
  for (uint64_t seed = 0; seed < 400; ++seed) {
    Case one;
    make_case(seed, one);
    const Instance& instance = one.mirror.instances()[0];
    std::set<uint32_t> drawn;
    for (const ClusterDraw& draw : one.list.clusters) EXPECT_TRUE(drawn.insert(draw.cluster.first_index).second);
    for (const TreeNode& node : instance.geometry->occluding) {
      if (!node.is_leaf()) continue;
      if (drawn.contains(node.first_index)) {
        ++kept;
        continue;
      }
      ++culled;
      for (uint32_t i = node.first_index; i < node.first_index + node.index_count; i += 3)
        for (int y = 0; y < one.view.height; ++y)
          for (int x = 0; x < one.view.width; ++x)
            ASSERT_TRUE(std::isinf(depth_of(one.view, x, y, world_triangle(instance, i)))) << seed;
    }
  }
  EXPECT_GT(culled, 500u);
  EXPECT_GT(kept, 200u);
}

TEST(CullTest, AClusterShowsOnlyWithinItsRectangleAndBehindItsNearDepth) {
  size_t shown = 0;
  for (uint64_t seed = 1000; seed < 1100; ++seed) {
    Case one;
    make_case(seed, one);
    for (const ClusterDraw& draw : one.list.clusters) {
      const VisibleCluster& cluster = draw.cluster;
      for (uint32_t i = cluster.first_index; i < cluster.first_index + cluster.index_count; i += 3)
        for (int y = 0; y < one.view.height; ++y)
          for (int x = 0; x < one.view.width; ++x) {
            const double depth = depth_of(one.view, x, y, world_triangle(one.mirror.instances()[0], i));
            if (std::isinf(depth)) continue;
            ++shown;
            ASSERT_TRUE(x >= cluster.x0 && x <= cluster.x1 && y >= cluster.y0 && y <= cluster.y1) << seed;
            ASSERT_GE(depth, cluster.near_depth_m * (1 - 1e-5)) << seed;
          }
    }
  }
  EXPECT_GT(shown, 1000u);
}

TEST(CullTest, ATriangleThatIsDroppedCoversNoSampleOrIsHidden) {
  size_t dropped = 0, kept = 0;
  for (uint64_t seed = 2000; seed < 2100; ++seed) {
    Case one;
    make_case(seed, one);
    // In every other case a curtain hangs in front of the left half.
    std::vector<float> depth(static_cast<size_t>(one.view.width) * one.view.height,
                             std::numeric_limits<float>::infinity());
    for (size_t texel = 0; seed % 2 && texel < depth.size(); ++texel)
      if (static_cast<int>(texel) % one.view.width < one.view.width / 2) depth[texel] = 3.0f;
    for (const ClusterDraw& draw : one.list.clusters) {
      std::vector<uint32_t> indices;
      append_visible_triangles(*one.mirror.instances()[0].geometry, draw.cluster,
                               one.list.instances[draw.instance].grid, depth.data(), indices);
      kept += indices.size() / 3;
      for (uint32_t i = draw.cluster.first_index; i < draw.cluster.first_index + draw.cluster.index_count; i += 3) {
        if (std::ranges::count(indices, i) > 0) continue;
        ++dropped;
        for (int y = 0; y < one.view.height; ++y)
          for (int x = 0; x < one.view.width; ++x)
            ASSERT_GE(depth_of(one.view, x, y, world_triangle(one.mirror.instances()[0], i)),
                      depth[static_cast<size_t>(y) * one.view.width + x]) << seed;
      }
    }
  }
  EXPECT_GT(dropped, 1000u);
  EXPECT_GT(kept, 500u);
}

TEST(CullTest, ClustersComeNearestFirst) {
  SceneMaker maker(3);
  SceneMirror mirror;
  ASSERT_TRUE(mirror.apply(maker.scene(30), {}));
  OccluderTable table;
  table.take_in(mirror);
  DrawList list;
  for (int i = 0; i < 5; ++i) table.append_map(mirror, {.view = maker.view()}, list);
  ASSERT_EQ(list.maps.size(), 5u);
  for (const MapDraw& map : list.maps)
    for (uint32_t i = map.first_cluster + 1; i < map.end_cluster; ++i)
      EXPECT_LE(list.clusters[i - 1].cluster.near_depth_m, list.clusters[i].cluster.near_depth_m);
}

TEST(CullTest, HiddenMeansNearerInEverySampleOfTheRectangle) {
  std::vector<float> depth(25, 1.0f);
  const VisibleCluster cluster{.index_count = 3, .near_depth_m = 2.0f, .x0 = 1, .x1 = 3, .y0 = 2, .y1 = 4};
  EXPECT_TRUE(is_hidden(cluster, depth.data(), 5));
  depth[0] = std::numeric_limits<float>::infinity();  // outside the rectangle
  EXPECT_TRUE(is_hidden(cluster, depth.data(), 5));
  depth[2 * 5 + 1] = 1.9999f;  // nearer, but not for certain
  EXPECT_FALSE(is_hidden(cluster, depth.data(), 5));
  depth[2 * 5 + 1] = 1.0f;
  depth[4 * 5 + 3] = std::numeric_limits<float>::infinity();
  EXPECT_FALSE(is_hidden(cluster, depth.data(), 5));
}

}  // namespace
}  // namespace sightline
