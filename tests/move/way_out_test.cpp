// A camera that was opened inside a collider leaves it by the shortest way, within its limits.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "server/base/random.h"
#include "server/move/body.h"
#include "server/move/motion.h"
#include "server/sample/embree_scene.h"
#include "server/scene/primitives.h"

namespace sightline {
namespace {

struct Block {
  glm::dvec3 at{0.0};
  glm::dvec3 half{0.5};
  glm::dquat turn{1, 0, 0, 0};

  glm::dvec3 local(const glm::dvec3& p) const { return glm::conjugate(turn) * (p - at); }
  bool contains(const glm::dvec3& p) const {
    const glm::dvec3 q = glm::abs(local(p));
    return q.x < half.x && q.y < half.y && q.z < half.z;
  }
  // To the surface from outside; 0 inside.
  double distance_m(const glm::dvec3& p) const {
    return glm::length(glm::max(glm::abs(local(p)) - half, glm::dvec3(0.0)));
  }
};

glm::dquat random_turn(CounterRandom& random) {
  return glm::normalize(
      glm::dquat(random.next_in(-1, 1), random.next_in(-1, 1), random.next_in(-1, 1), random.next_in(-1, 1)));
}

class WayOutOf : public testing::Test {
 protected:
  void add(const Block& block) {
    blocks_.push_back(block);
    SceneDelta delta;
    delta.add.push_back({blocks_.size(),
                         *store_.intern(*tessellate(BoxShape{glm::vec3(block.half)})),
                         Pose{block.at, block.turn},
                         glm::dmat3(1),
                         {}});
    ASSERT_TRUE(mirror_.apply(delta, {}));
  }
  void add_mesh(MeshData mesh) {
    SceneDelta delta;
    delta.add.push_back({1000, *store_.intern(std::move(mesh)), Pose{}, glm::dmat3(1), {}});
    ASSERT_TRUE(mirror_.apply(delta, {}));
  }
  void clear() {
    SceneDelta delta;
    for (uint64_t id = 1; id <= blocks_.size(); ++id) delta.remove.push_back(id);
    ASSERT_TRUE(mirror_.apply(delta, {}));
    blocks_.clear();
  }
  ClearanceField& gathered(const glm::dvec3& at) {
    field_.gather(mirror_, at, 20.0, {});
    return field_;
  }
  bool is_free(const glm::dvec3& p, double room_m) const {
    return std::ranges::all_of(blocks_, [&](const Block& b) { return !b.contains(p) && b.distance_m(p) >= room_m; });
  }
  // The distance to the nearest free place, by looking at every place of a grid of `spacing_m`: too long by at most its
  // diagonal.
  double shortest_m(const glm::dvec3& from, double room_m, double reach_m, double spacing_m) const {
    double least_m = std::numeric_limits<double>::infinity();
    const int n = static_cast<int>(reach_m / spacing_m);
    for (int x = -n; x <= n; ++x)
      for (int y = -n; y <= n; ++y)
        for (int z = -n; z <= n; ++z) {
          const glm::dvec3 way = spacing_m * glm::dvec3(x, y, z);
          if (glm::length(way) < least_m && is_free(from + way, room_m)) least_m = glm::length(way);
        }
    return least_m;
  }

  // Lets the camera leave, and checks the limits. Returns the length of its path; infinity if it is not free in time.
  double leave_m(glm::dvec3& at) {
    constexpr double kDt = 1.0 / 60;
    CameraState camera;
    camera.pose.position_m = at;
    double path_m = 0;
    for (int i = 0; i < 600; ++i) {
      const SafeMove move = make_safe(camera, clamp_velocity(camera.velocity_mps, glm::dvec3(0.0), limits_, kDt),
                                      limits_, {}, gathered(camera.pose.position_m), kDt, true);
      EXPECT_LE(glm::length(move.velocity_mps), limits_.max_speed_mps * (1 + 1e-9));
      EXPECT_LE(glm::length(move.velocity_mps - camera.velocity_mps), limits_.max_acceleration_mps2 * kDt * (1 + 1e-9));
      camera.velocity_mps = move.velocity_mps;
      camera.pose.position_m += move.velocity_mps * kDt;
      path_m += glm::length(move.velocity_mps) * kDt;
      if (!move.overlap && glm::length(move.velocity_mps) < 1e-6) {
        at = camera.pose.position_m;
        return path_m;
      }
    }
    return std::numeric_limits<double>::infinity();
  }

  GeometryStore store_;
  SceneMirror mirror_;
  ClearanceField field_;
  std::vector<Block> blocks_;
  const CameraLimits limits_;
};

TEST_F(WayOutOf, APointIsInsideWhenABoxContainsIt) {
  CounterRandom random(91, 0, RandomPurpose::kTest);
  int inside = 0;
  for (int scene = 0; scene < 5; ++scene) {
    for (int i = 0; i < 12; ++i)  // many overlap
      add({{random.next_in(-3, 3), random.next_in(-3, 3), random.next_in(-3, 3)},
           {random.next_in(0.1, 2), random.next_in(0.1, 2), random.next_in(0.1, 2)},
           random_turn(random)});
    for (int i = 0; i < 400; ++i) {
      const glm::dvec3 p(random.next_in(-5, 5), random.next_in(-5, 5), random.next_in(-5, 5));
      const bool expected = std::ranges::any_of(blocks_, [&](const Block& b) { return b.contains(p); });
      EXPECT_EQ(gathered({}).is_inside(p), expected) << p.x << ' ' << p.y << ' ' << p.z;
      inside += expected;
    }
    clear();
  }
  EXPECT_GT(inside, 100);
}

// A box whose faces look inwards is a room, and what is outside of it is solid.
TEST_F(WayOutOf, ARoomThatIsModelledFromInsideIsNotASolid) {
  MeshData room = *tessellate(BoxShape{{3, 3, 3}});
  for (size_t i = 0; i < room.indices.size(); i += 3) std::swap(room.indices[i], room.indices[i + 1]);
  add_mesh(std::move(room));
  EXPECT_FALSE(gathered({}).is_inside({0.3, 0.2, -0.4}));
  add({{1, 1, 1}, {0.5, 0.5, 0.5}});
  EXPECT_TRUE(gathered({}).is_inside({1.1, 0.9, 1.2})) << "a block in the room";
}

TEST_F(WayOutOf, WhatIsUnderARoofIsNotInsideIt) {
  add_mesh({{{-9, 2, -9}, {-9, 2, 9}, {9, 2, 9}, {9, 2, -9}}, {0, 1, 2, 0, 2, 3}, UINT32_MAX});
  EXPECT_FALSE(gathered({}).is_inside({0, 1.9, 0}));
  EXPECT_FALSE(gathered({}).is_inside({0, 2.1, 0}));
}

// Walls from 0.1 to 0.6 m, pillars, floors and thick blocks: from any depth the camera leaves straight across the
// nearest face.
TEST_F(WayOutOf, ASingleBlockIsLeftAcrossItsNearestFace) {
  EmbreeDevice device;
  CounterRandom random(92, 0, RandomPurpose::kTest);
  const std::vector<glm::dvec3> halves = {{3, 1.5, 0.05}, {3, 1.5, 0.15},  {0.3, 2, 3}, {0.2, 2, 0.2},
                                          {5, 0.1, 5},    {1.5, 1.5, 1.5}, {2.5, 2, 3}};
  for (const glm::dvec3& half : halves)
    for (int i = 0; i < 12; ++i) {
      const Block block{{random.next_in(-2, 2), random.next_in(-2, 2), random.next_in(-2, 2)},
                        half,
                        i % 3 == 0 ? glm::dquat(1, 0, 0, 0) : random_turn(random)};
      add(block);
      const glm::dvec3 deep = half * glm::dvec3(random.next_in(-0.98, 0.98), random.next_in(-0.98, 0.98),
                                                random.next_in(-0.98, 0.98));
      const glm::dvec3 to_face = half - glm::abs(deep);
      const double nearest_m = std::min({to_face.x, to_face.y, to_face.z});
      glm::dvec3 at = block.at + block.turn * deep;
      const double path_m = leave_m(at);
      const double expected_m = nearest_m + limits_.body_radius_m + kBodySkinM;
      EXPECT_LE(path_m, 1.05 * expected_m + 0.03) << i;
      EXPECT_TRUE(is_free(at, limits_.body_radius_m - 1e-6));
      EmbreeScene reference(device, EmbreeScene::Content::kColliders);
      reference.take_in(mirror_);
      EXPECT_GE(reference.nearest_surface_m(at, 5.0f), limits_.body_radius_m - 1e-4);
      clear();
    }
}

// Walls on floors, walls beside walls and pillars in walls: no place that a fine grid finds is much nearer.
TEST_F(WayOutOf, AmongSeveralBlocksTheWayIsNearlyTheShortest) {
  CounterRandom random(93, 0, RandomPurpose::kTest);
  const double room_m = limits_.body_radius_m + kBodySkinM;
  for (int scene = 0; scene < 12; ++scene) {
    add({{0, -0.1, 0}, {6, 0.1, 6}});
    add({{0, 1.2, 0}, {3, 1.3, 0.15}});
    add({{random.next_in(-1, 1), 1, random.next_in(-0.3, 0.3)}, {0.25, 1.5, 0.25}, random_turn(random)});
    add({{random.next_in(-2, 2), 1, random.next_in(0.3, 1.0)}, {1, 1.5, 0.1}});
    const glm::dvec3 from(random.next_in(-1, 1), random.next_in(0.1, 1.2), random.next_in(-0.14, 0.14));
    const auto out_m = way_out(gathered(from), from, limits_.body_radius_m);
    ASSERT_TRUE(out_m.has_value()) << scene;
    EXPECT_TRUE(is_free(*out_m, room_m - 1e-5)) << scene;
    constexpr double kSpacingM = 0.05;
    const double found_m = glm::distance(from, *out_m);
    EXPECT_LE(found_m, 1.15 * shortest_m(from, room_m, std::min(found_m + 0.1, 2.0), kSpacingM)) << scene;
    clear();
  }
}

// Two walls leave a gap that is narrower than the body. The camera starts in it and leaves along it, through neither
// wall.
TEST_F(WayOutOf, ANarrowGapIsLeftAlongIt) {
  add({{-0.7, 0, 0}, {0.45, 5, 2}});
  add({{0.7, 0, 0}, {0.45, 5, 2}});  // the gap is 0.5 m wide
  glm::dvec3 at(0.05, 0, 1.4);
  EXPECT_LT(leave_m(at), 1.5);
  EXPECT_GT(at.z, 2.0);
  EXPECT_LT(std::abs(at.x), 0.7);
}

TEST_F(WayOutOf, ACameraThatSeesATargetIsNotTakenToBeWalledIn) {
  add({{0, 0, 0}, {4, 4, 4}});
  const CameraState camera;
  EXPECT_FALSE(make_safe(camera, glm::dvec3(0.0), limits_, {}, gathered({}), 1.0 / 60).overlap);
  EXPECT_TRUE(make_safe(camera, glm::dvec3(0.0), limits_, {}, gathered({}), 1.0 / 60, true).overlap);
}

}  // namespace
}  // namespace sightline
