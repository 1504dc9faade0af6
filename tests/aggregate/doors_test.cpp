// Doors: what is taken for one, and what it hides, against a plain test with the two triangles of its plate.
#include "server/aggregate/doors.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "server/scene/primitives.h"

namespace sightline {
namespace {

constexpr double kTick = 1.0 / 60;

// A world with one body that moves as a test says.
class World {
 public:
  explicit World(const glm::dvec3& half_m, InstanceAttributes attributes = {}) {
    SceneDelta delta;
    delta.add.push_back({.id = 7,
                         .geometry = *store_.intern(*tessellate(BoxShape{glm::vec3(half_m)})),
                         .pose = {start_m, {1, 0, 0, 0}},
                         .linear = glm::dmat3(1.0),
                         .attributes = attributes,
                         .moving = true});
    EXPECT_TRUE(mirror_.apply(delta, {}));
  }

  // Stays or moves for a time at a velocity.
  void pass(double seconds, const glm::dvec3& velocity_mps = {}) {
    for (int i = 0; i < static_cast<int>(std::lround(seconds / kTick)); ++i) {
      at_m += velocity_mps * kTick, clock_s += kTick;
      TransformUpdate update;
      update.ids = {7}, update.poses = {{at_m, {1, 0, 0, 0}}};
      ASSERT_TRUE(mirror_.apply({}, update));
      doors.pass(mirror_, targets, kTick, clock_s);
    }
  }
  void take_away() {
    SceneDelta delta;
    delta.remove = {7};
    ASSERT_TRUE(mirror_.apply(delta, {}));
    doors.pass(mirror_, targets, kTick, clock_s += kTick);
  }
  OpenDoors open() const { return doors.open({0, 1, -3}, 1, {0, 1, 3}); }

  static constexpr glm::dvec3 start_m{0, 1, 0};
  glm::dvec3 at_m = start_m;
  double clock_s = 0;
  std::vector<uint64_t> targets;
  Doors doors;

 private:
  GeometryStore store_;
  SceneMirror mirror_;
};

constexpr glm::dvec3 kLeaf{0.6, 1.0, 0.05}, kAside{1.2, 0, 0};

TEST(Doors, ALeafThatSlidesAsideIsOpenUntilItIsBack) {
  World world(kLeaf);
  world.pass(1.0);
  EXPECT_TRUE(world.open().empty()) << "shut";
  world.pass(1.0, kAside);
  const OpenDoors open = world.open();
  ASSERT_EQ(open.size(), 1u);
  EXPECT_LT(glm::distance(open[0].shut.middle_m, World::start_m), 1e-9) << "where it shuts, not where it is";
  EXPECT_GT(open[0].weight, 0.8f);
  world.pass(1.0, -kAside);
  EXPECT_TRUE(world.open().empty());
}

TEST(Doors, OneThatIsOpenForLongIsForgotten) {
  World world(kLeaf);
  world.pass(1.0), world.pass(1.0, kAside);
  const float weight = world.open()[0].weight;
  world.pass(3.0);
  EXPECT_LT(world.open()[0].weight, 0.7f * weight);
  world.pass(30.0);
  EXPECT_TRUE(world.open().empty());
}

TEST(Doors, WhatMovesForTheFirstTimeHasRested) {
  World world(kLeaf);
  world.clock_s = 20;
  world.pass(0.5, kAside);
  EXPECT_EQ(world.open().size(), 1u);
  World at_once(kLeaf);
  at_once.pass(0.5, kAside);
  EXPECT_TRUE(at_once.open().empty()) << "it has moved since the session opened";
}

TEST(Doors, WhoeverLeavesIsNone) {
  World world(kLeaf);
  world.pass(1.0), world.pass(3.0, kAside);
  EXPECT_TRUE(world.open().empty());
}

TEST(Doors, WhatIsNotThinOrHidesNothingOrLetsPassIsNone) {
  const auto opens = [](World world) {
    world.pass(1.0), world.pass(0.5, kAside);
    return !world.open().empty();
  };
  EXPECT_TRUE(opens(World(kLeaf)));
  EXPECT_FALSE(opens(World({0.3, 0.9, 0.3}))) << "a person";
  EXPECT_FALSE(opens(World({1.2, 1.25, 1.2}))) << "a cabin";
  EXPECT_FALSE(opens(World(kLeaf, {.collides = false}))) << "a curtain";
  EXPECT_FALSE(opens(World(kLeaf, {.occludes = false}))) << "a pane of glass";
  World target(kLeaf);
  target.targets = {7};
  target.pass(1.0), target.pass(0.5, kAside);
  EXPECT_TRUE(target.open().empty());
}

TEST(Doors, OneThatIsRemovedIsForgotten) {
  World world(kLeaf);
  world.pass(1.0), world.pass(0.5, kAside);
  ASSERT_EQ(world.open().size(), 1u);
  world.take_away();
  EXPECT_TRUE(world.open().empty());
}

TEST(Doors, OneThatCannotLieBetweenIsLeftOut) {
  World world(kLeaf);
  world.pass(1.0), world.pass(0.5, kAside);
  EXPECT_TRUE(world.doors.open({0, 1, -30}, 1, {0, 1, -20}).empty());
}

// A client may send as many as it likes.
TEST(Doors, OfManyTheNearestCount) {
  constexpr int kDoors = 40;
  GeometryStore store;
  const auto geometry = *store.intern(*tessellate(BoxShape{glm::vec3(kLeaf)}));
  SceneMirror mirror;
  SceneDelta delta;
  TransformUpdate update;
  for (int k = 0; k < kDoors; ++k) {
    const auto id = static_cast<uint64_t>(1 + (k * 17) % kDoors);  // not in the order of the distance
    const Pose pose{{0, 1, 0.5 * k}, {1, 0, 0, 0}};
    delta.add.push_back({.id = id, .geometry = geometry, .pose = pose, .linear = glm::dmat3(1.0), .attributes = {}});
    update.ids.push_back(id), update.poses.push_back(pose);
  }
  ASSERT_TRUE(mirror.apply(delta, update));
  Doors doors;
  for (int tick = 1; tick <= 60; ++tick) doors.pass(mirror, {}, kTick, tick * kTick);
  for (Pose& pose : update.poses) pose.position_m.x += 0.5;
  ASSERT_TRUE(mirror.apply({}, update));
  doors.pass(mirror, {}, kTick, 1 + kTick);
  const OpenDoors open = doors.open({0, 1, -1}, 1, {0, 1, 30});
  ASSERT_EQ(open.size(), kMostOpenDoors);
  for (const OpenDoor& door : open) EXPECT_LT(door.shut.middle_m.z, 0.5 * kMostOpenDoors);
}

// Where the segment from `from_m` to `to_m` crosses the triangle (Moller and Trumbore).
bool crosses(const glm::dvec3& from_m, const glm::dvec3& to_m, const glm::dvec3& a, const glm::dvec3& b,
             const glm::dvec3& c) {
  const glm::dvec3 way = to_m - from_m, ab = b - a, ac = c - a, p = glm::cross(way, ac), s = from_m - a,
                   q = glm::cross(s, ab);
  const double det = glm::dot(ab, p);
  if (std::abs(det) < 1e-12) return false;
  const double u = glm::dot(s, p) / det, v = glm::dot(way, q) / det, t = glm::dot(ac, q) / det;
  return u >= 0 && v >= 0 && u + v <= 1 && t >= 0 && t <= 1;
}

TEST(Doors, HideWhatTheirPlateCrosses) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> unit(-1, 1);
  const auto point = [&](double scale) { return glm::dvec3(unit(random), unit(random), unit(random)) * scale; };
  size_t hidden_count = 0, apart = 0, all = 0;
  for (int round = 0; round < 200; ++round) {
    const glm::dvec3 origin_m = point(50), normal = glm::normalize(point(1)),
                     u = glm::normalize(glm::cross(normal, point(1))), v = glm::cross(normal, u);
    const OpenDoor door{{origin_m + point(2), u * (0.3 + std::abs(unit(random))), v * (0.5 + std::abs(unit(random)))},
                        0.75f};
    const glm::dvec3 to_m = origin_m + point(5);
    std::vector<float> x, y, z, hidden(100, 0.0f);
    for (size_t i = 0; i < hidden.size(); ++i) {
      const glm::vec3 p(point(5));
      x.push_back(p.x), y.push_back(p.y), z.push_back(p.z);
    }
    hide_behind(door, {x.data(), y.data(), z.data(), origin_m}, to_m, hidden);
    const auto& [middle, half_u, half_v] = door.shut;
    const glm::dvec3 a = middle - half_u - half_v, b = middle + half_u - half_v, c = middle + half_u + half_v,
                     d = middle - half_u + half_v;
    for (size_t i = 0; i < hidden.size(); ++i) {
      const glm::dvec3 from_m = origin_m + glm::dvec3(x[i], y[i], z[i]);
      const bool expected = crosses(from_m, to_m, a, b, c) || crosses(from_m, to_m, a, c, d);
      hidden_count += expected, ++all;
      apart += (hidden[i] > 0) != expected;
      if (hidden[i] > 0) {
        EXPECT_EQ(hidden[i], 0.75f);
      }
    }
  }
  EXPECT_GT(hidden_count, all / 100);
  EXPECT_LE(apart, all / 2000) << "only where the line grazes the edge";
}

}  // namespace
}  // namespace sightline
