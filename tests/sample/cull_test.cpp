// Culling and the search of samples against brute force: no triangle that a sample shows may be left out.
#include "server/sample/cull.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <tuple>

#include "server/sample/occluder_tree.h"
#include "server/sample/sample_search.h"
#include "server/sample/triangle_block.h"
#include "tests/sample/scene_maker.h"

namespace sightline {
namespace {

using test::SceneMaker;

// The depth along the view axis at which the ray of a sample meets a triangle; infinity when it does not, or before
// the near plane.
double depth_of(const MapView& view, int x, int y, const std::array<glm::dvec3, 3>& corner) {
  const glm::dvec3 d = texel_direction(view, x, y), ab = corner[1] - corner[0], ac = corner[2] - corner[0];
  const glm::dvec3 p = glm::cross(d, ac), s = view.eye_m - corner[0], q = glm::cross(s, ab);
  const double det = glm::dot(ab, p), u = glm::dot(s, p) / det, v = glm::dot(d, q) / det, t = glm::dot(ac, q) / det;
  return u >= 0 && v >= 0 && u + v <= 1 && t >= view.near_m ? t : std::numeric_limits<double>::infinity();
}

TEST(CullTest, ABoxThatHoldsAPointOfASampleRayMayShowThere) {
  SceneMaker maker(1);
  size_t beside = 0;
  for (int i = 0; i < 2000; ++i) {
    const MapView view = maker.view();
    const SampleGrid grid = sample_grid(clip_rows(clip_map(view), view, identity_affine()), view);
    const int x = static_cast<int>(maker.random().next_below(static_cast<uint32_t>(view.width))),
              y = static_cast<int>(maker.random().next_below(static_cast<uint32_t>(view.height)));
    const double depth = view.near_m + maker.random().next_in(0.001, 10.0);
    const glm::vec3 on_ray(view.eye_m + depth * texel_direction(view, x, y));
    Aabb box, other;
    box.grow(on_ray - glm::vec3(maker.random().next_unit(), maker.random().next_unit(), maker.random().next_unit()));
    box.grow(on_ray + glm::vec3(maker.random().next_unit(), maker.random().next_unit(), maker.random().next_unit()));
    other.grow(glm::vec3(maker.pose().position_m) - 0.1f), other.grow(other.min + 0.2f);
    const BoxTest test(grid, {glm::vec3(-30.0f), glm::vec3(30.0f)});
    Footprint where;
    ASSERT_TRUE(test.may_show(box, where));
    EXPECT_TRUE(x >= where.x0 && x <= where.x1 && y >= where.y0 && y <= where.y1);
    EXPECT_LE(where.near_depth_m, depth * (1 + 1e-5));
    beside += !test.may_show(other, where);
  }
  EXPECT_GT(beside, 500u);
}

// Random triangles against Moeller & Trumbore in double, many of them reaching behind the eye.
TEST(CullTest, WhatSurelyCoversASampleDoesAndWhatCannotDoesNot) {
  SceneMaker maker(5);
  size_t certain = 0, impossible = 0, behind = 0;
  for (int i = 0; i < 3000; ++i) {
    const MapView view = maker.view();
    const SampleGrid grid = sample_grid(clip_rows(clip_map(view), view, identity_affine()), view);
    MeshData mesh;
    for (int k = 0; k < 3; ++k)
      mesh.positions.push_back(glm::vec3(maker.pose().position_m * maker.random().next_in(0.1, 3.0)));
    mesh.indices = {0, 1, 2};
    const auto geometry = build_geometry(mesh).value();
    const GridSlack slack = grid_slack(grid, geometry->bounds);
    TriangleBlock block;
    read_triangles(*geometry, 0, 3, block);
    project_triangles(grid, slack, block);
    const std::array<glm::dvec3, 3> corner{mesh.positions[0], mesh.positions[1], mesh.positions[2]};
    behind += block.w[0][0] < 0 || block.w[1][0] < 0 || block.w[2][0] < 0;
    for (int y = 0; y < view.height; ++y)
      for (int x = 0; x < view.width; ++x) {
        const double depth = depth_of(view, x, y, corner);
        const bool in_range = x >= block.x0[0] && x <= block.x1[0] && y >= block.y0[0] && y <= block.y1[0];
        const Cover cover = cover_of(block, 0, x, y, slack, grid.near_m);
        if (std::isfinite(depth)) {
          ASSERT_TRUE(in_range) << i;
          ASSERT_TRUE(cover.possible) << i;
          ASSERT_GE(depth, cover.low_m * (1 - 1e-5)) << i;
          ASSERT_LE(depth, cover.high_m * (1 + 1e-5)) << i;
        } else {
          ASSERT_FALSE(cover.certain) << i;
        }
        certain += cover.certain, impossible += !cover.possible;
      }
  }
  EXPECT_GT(certain, 5000u);
  EXPECT_GT(impossible, 50000u);
  EXPECT_GT(behind, 500u);
}

TEST(CullTest, HiddenMeansNearerInEverySampleOfTheFootprint) {
  std::vector<float> depth(25, 1.0f);
  const Footprint where{.near_depth_m = 2.0f, .x0 = 1, .x1 = 3, .y0 = 2, .y1 = 4};
  EXPECT_TRUE(is_hidden(where, depth.data(), 5));
  depth[0] = std::numeric_limits<float>::infinity();  // outside the footprint
  EXPECT_TRUE(is_hidden(where, depth.data(), 5));
  depth[2 * 5 + 1] = 1.9999f;  // nearer, but not for certain
  EXPECT_FALSE(is_hidden(where, depth.data(), 5));
  depth[2 * 5 + 1] = 1.0f;
  depth[4 * 5 + 3] = std::numeric_limits<float>::infinity();
  EXPECT_FALSE(is_hidden(where, depth.data(), 5));
}

// A scene, one view of it, and the triangles that culling keeps.
struct Case {
  SceneMirror mirror;
  MapView view;
  DrawList list;

  explicit Case(uint64_t seed) {
    SceneMaker maker(seed);
    const uint32_t count = 1 + maker.random().next_below(20);
    EXPECT_TRUE(mirror.apply(maker.scene(count), {}));
    EXPECT_TRUE(mirror.apply({}, maker.moves(mirror, count)));
    view = maker.view();
    OccluderTable table;
    table.take_in(mirror, 0.0);
    SampleSearch().append_map(table, mirror, {.view = view}, list);
  }
  bool draws(uint32_t slot, uint32_t first_index) const {
    return std::ranges::any_of(list.triangles, [&](const TriangleDraw& triangle) {
      return list.instances[triangle.instance].slot == slot && triangle.first_index == first_index;
    });
  }
};

std::array<glm::dvec3, 3> world_triangle(const Instance& instance, uint32_t first_index) {
  std::array<glm::dvec3, 3> corner;
  for (uint32_t k = 0; k < 3; ++k)
    corner[k] = transform_point(instance.world_from_instance,
                                glm::dvec3(instance.geometry->positions[instance.geometry->indices[first_index + k]]));
  return corner;
}

// The visible instance and depth at one sample, by trying every triangle of the scene.
struct Nearest {
  double depth = std::numeric_limits<double>::infinity();
  uint32_t slot = 0, first_index = 0;
};
template <typename Visit>
void for_each_occluding_triangle(const SceneMirror& mirror, const Visit& visit) {
  for (uint32_t slot = 0; slot < mirror.instances().size(); ++slot) {
    const Instance& instance = mirror.instances()[slot];
    if (!instance.geometry || !instance.occludes()) continue;
    for (uint32_t i = 0; i < instance.geometry->occluding_index_count; i += 3)
      visit(slot, i, world_triangle(instance, i));
  }
}

TEST(SampleSearchTest, TheNearestTriangleOfEverySampleIsDrawnAndLittleElse) {
  size_t seen = 0, drawn = 0, all = 0, samples = 0;
  for (uint64_t seed = 0; seed < 150; ++seed) {
    const Case one(seed);
    std::vector<Nearest> nearest(static_cast<size_t>(one.view.width) * one.view.height);
    for_each_occluding_triangle(one.mirror, [&](uint32_t slot, uint32_t first_index, const auto& corner) {
      ++all;
      for (size_t i = 0; i < nearest.size(); ++i) {
        const int x = static_cast<int>(i) % one.view.width, y = static_cast<int>(i) / one.view.width;
        const double depth = depth_of(one.view, x, y, corner);
        if (depth < nearest[i].depth) nearest[i] = {depth, slot, first_index};
      }
    });
    for (const Nearest& n : nearest) {
      if (std::isinf(n.depth)) continue;
      ++seen;
      ASSERT_TRUE(one.draws(n.slot, n.first_index)) << seed;
    }
    drawn += one.list.triangles.size();
    samples += nearest.size();
  }
  EXPECT_GT(seen, samples / 10);
  EXPECT_LT(drawn, samples);
  EXPECT_LT(drawn, all / 3);
}

TEST(SampleSearchTest, TrianglesStandMapByMapInTheOrderOfSlots) {
  SceneMaker maker(3);
  SceneMirror mirror;
  ASSERT_TRUE(mirror.apply(maker.scene(30), {}));
  OccluderTable table;
  table.take_in(mirror, 0.0);
  DrawList list;
  SampleSearch search;
  for (int i = 0; i < 5; ++i) search.append_map(table, mirror, {.view = maker.view()}, list);
  EXPECT_EQ(list.map_count, 5u);
  EXPECT_GT(list.triangles.size(), 100u);
  const auto place = [&](const TriangleDraw& triangle) {
    const InstanceDraw& instance = list.instances[triangle.instance];
    return std::tuple(instance.map, instance.slot, triangle.first_index);
  };
  for (size_t i = 1; i < list.triangles.size(); ++i)
    EXPECT_LT(place(list.triangles[i - 1]), place(list.triangles[i])) << i;
}

// Walls behind walls: nothing behind the first one is even opened, however much there is.
TEST(SampleSearchTest, WhatIsHiddenCostsNothingToDraw) {
  const auto wall = build_geometry(tessellate(BoxShape{{20.0f, 20.0f, 0.1f}}).value()).value();
  SceneMirror mirror;
  SceneDelta delta;
  for (uint64_t id = 1; id <= 100; ++id)
    delta.add.push_back(
        {.id = id, .geometry = wall, .pose = {{0, 0, -3.0 * static_cast<double>(id)}}, .attributes = {}});
  ASSERT_TRUE(mirror.apply(delta, {}));
  MapView view;
  view.left = view.bottom = -0.3, view.right = view.top = 0.3;
  OccluderTable table;
  table.take_in(mirror, 0.0);
  DrawList list;
  SampleSearch().append_map(table, mirror, {.view = view}, list);
  for (const InstanceDraw& draw : list.instances) EXPECT_EQ(draw.slot, *mirror.slot_of(1));
  EXPECT_LE(list.triangles.size(), 2u);
}

void expect_tree_of(const OccluderTree& tree, const std::set<uint32_t>& slots, const SceneMirror& mirror,
                    double ahead_s) {
  std::set<uint32_t> found;
  for (const TreeNode& node : tree.nodes) {
    if (!node.is_leaf()) continue;
    for (uint32_t i = node.first_index; i < node.first_index + node.index_count; ++i) {
      const Instance& instance = mirror.instances()[tree.occluders[i].slot];
      EXPECT_TRUE(found.insert(tree.occluders[i].slot).second);
      for (const double at_s : {0.0, 0.3 * ahead_s, ahead_s})
        for (int axis = 0; axis < 3; ++axis) {
          const double center = transform_point(world_from_instance_ahead(instance, at_s),
                                                glm::dvec3(instance.geometry->center))[axis];
          EXPECT_LE(node.bounds.min[axis], center - instance.radius_m);
          EXPECT_GE(node.bounds.max[axis], center + instance.radius_m);
        }
    }
  }
  EXPECT_EQ(found, slots);
}

TEST(OccluderTreeTest, HoldsEveryOccluderOnceWithinItsBoxesNowAndAhead) {
  constexpr double kAheadS = 0.5;
  for (uint64_t seed = 0; seed < 40; ++seed) {
    SceneMaker maker(seed);
    SceneMirror mirror;
    ASSERT_TRUE(mirror.apply(maker.scene(40), {}));
    OccluderTable table;
    for (int round = 0; round < 3; ++round) {
      TransformUpdate moves = maker.moves(mirror, 40);
      for (size_t i = 0; i < moves.ids.size(); ++i)
        moves.velocities_mps.emplace_back(3.0, -1.0, 2.0), moves.angular_velocities_radps.emplace_back(i % 3, 4.0, 0.0);
      ASSERT_TRUE(mirror.apply({}, moves));
      table.take_in(mirror, kAheadS);
      std::set<uint32_t> fixed, moving;
      for (uint32_t slot = 0; slot < mirror.instances().size(); ++slot) {
        const Instance& instance = mirror.instances()[slot];
        if (instance.geometry && instance.occludes() && instance.geometry->occluding_index_count > 0)
          (instance.moving ? moving : fixed).insert(slot);
      }
      expect_tree_of(table.fixed(), fixed, mirror, kAheadS);
      expect_tree_of(table.moving(), moving, mirror, kAheadS);
    }
  }
}

}  // namespace
}  // namespace sightline
