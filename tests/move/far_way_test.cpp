#include "server/move/far_way.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "server/scene/primitives.h"
#include "tests/support/triangle_soup.h"

namespace sightline::test {
namespace {

constexpr double kBody_m = 0.25;

struct Searched {
  void add_box(uint64_t id, const glm::dvec3& at_m, const glm::vec3& half_m) {
    add(mirror,
        placed(id, build_geometry(tessellate(BoxShape{half_m}).value()).value(), {at_m, glm::dquat(1, 0, 0, 0)}));
  }
  bool find(const glm::dvec3& from_m, const glm::dvec3& to_m) {
    field.gather(mirror, from_m, 60.0, {});
    input = {.from_m = from_m, .to_m = to_m, .body_radius_m = kBody_m};
    return finder.find(field, input, points_m);
  }
  // The body is swept along the whole way, which the search itself never does.
  void expect_sound() const {
    ASSERT_FALSE(points_m.empty());
    glm::dvec3 at_m = input.from_m;
    for (const glm::dvec3& next_m : points_m) {
      EXPECT_EQ(field.free_fraction(at_m, next_m, kBody_m - 1e-6), 1.0);
      at_m = next_m;
    }
    EXPECT_LE(glm::distance(at_m, input.to_m), input.near_m);
  }
  double length_m() const {
    double length = 0;
    glm::dvec3 at_m = input.from_m;
    for (const glm::dvec3& next_m : points_m) length += glm::distance(at_m, next_m), at_m = next_m;
    return length;
  }
  SceneMirror mirror;
  ClearanceField field;
  FarWayFinder finder;
  FarWayInput input;
  WayPoints points_m;
};

// A room of 6 x 4 x 6 m around the origin, of six slabs. Its door, 1.2 m wide and 2.2 m high, is in the wall at +z.
struct Room : Searched {
  explicit Room(bool has_door) {
    add_box(1, {0, -2.1, 0}, {3.2, 0.1, 3.2});
    add_box(2, {0, 2.1, 0}, {3.2, 0.1, 3.2});
    add_box(3, {-3.1, 0, 0}, {0.1, 2, 3.2});
    add_box(4, {3.1, 0, 0}, {0.1, 2, 3.2});
    add_box(5, {0, 0, -3.1}, {3.2, 2, 0.1});
    if (!has_door) add_box(9, {0, 0, 3.1}, {0.6, 2, 0.1});
    add_box(6, {-1.9, 0, 3.1}, {1.3, 2, 0.1});
    add_box(7, {1.9, 0, 3.1}, {1.3, 2, 0.1});
    add_box(8, {0, 1.1, 3.1}, {0.6, 0.9, 0.1});
  }
};

TEST(FarWay, LeadsStraightWhereNothingIsInTheWay) {
  Searched world;
  ASSERT_TRUE(world.find({0.1, 0.2, 0.3}, {20, 1, -5}));
  world.expect_sound();
  EXPECT_LT(world.length_m(), 1.15 * glm::distance(world.input.from_m, world.input.to_m)) << "a grid has 26 directions";
}

TEST(FarWay, LeadsOutOfARoomThroughItsDoorAndRoundIt) {
  Room room(true);
  ASSERT_TRUE(room.find({0, 0, -2}, {0, 0, -6}));
  room.expect_sound();
  EXPECT_TRUE(std::any_of(room.points_m.begin(), room.points_m.end(), [](const glm::dvec3& p) { return p.z > 3.0; }));
}

TEST(FarWay, ThereIsNoneOutOfAClosedRoom) {
  Room room(false);
  EXPECT_FALSE(room.find({0, 0, -2}, {0, 0, -6}));
  EXPECT_TRUE(room.points_m.empty());
}

TEST(FarWay, EndsOnlyWhereNothingIsBetween) {
  Searched world;
  world.add_box(1, {0, 0, 0}, {0.05, 3, 3});
  ASSERT_TRUE(world.find({-1, 0, 0}, {1, 0, 0}));
  world.expect_sound();
  size_t blocker = 0;
  EXPECT_TRUE(world.field.is_free(world.points_m[world.points_m.size() - 1], world.input.to_m, 0.01, blocker));
  EXPECT_GT(world.length_m(), 3.0) << "round the edge of a thin wall that the target stands behind";
}

TEST(FarWay, IsSoundBetweenRandomTriangles) {
  Draw draw(41);
  int found = 0;
  for (int trial = 0; trial < 60; ++trial) {
    Searched world;
    add(world.mirror, placed(1, random_soup(draw, 60)));
    if (!world.find(draw.vec(3), draw.vec(3) + glm::dvec3(3, 0, 0))) continue;
    ++found;
    world.expect_sound();
  }
  EXPECT_GT(found, 20);
}

TEST(FarWay, KeepsItsDistanceAndNeedsNoWayWhereItIsNear) {
  Searched world;
  world.field.gather(world.mirror, {0, 0, 0}, 60.0, {});
  world.input = {.from_m = {8.1, 0, 0}, .to_m = {0, 0, 0}, .body_radius_m = kBody_m, .near_m = 4.0, .keep_off_m = 3.0};
  ASSERT_TRUE(world.finder.find(world.field, world.input, world.points_m));
  const double left_m = glm::length(world.points_m[world.points_m.size() - 1]);
  EXPECT_GE(left_m, 3.0);
  EXPECT_LE(left_m, 4.0);
  world.input.from_m = {3.5, 0, 0};
  EXPECT_FALSE(world.finder.find(world.field, world.input, world.points_m));
}

// Two long walls lie across the way, with gaps at opposite ends. A grid of 0.5 m would have too many cells.
TEST(FarWay, ACoarserGridLeadsFarther) {
  Searched world;
  world.add_box(1, {-10, 0, 60}, {60, 20, 1});
  world.add_box(2, {10, 0, 120}, {60, 20, 1});
  world.field.gather(world.mirror, {0, 0, 0}, FarWayFinder::kReachCells * 2.25, {});
  world.input = {.from_m = {0, 0, 0}, .to_m = {0, 0, 180}, .body_radius_m = kBody_m, .cell_m = 2.25, .near_m = 4.0};
  ASSERT_TRUE(world.finder.find(world.field, world.input, world.points_m));
  world.expect_sound();
  EXPECT_LT(world.length_m(), 280);
  world.input.cell_m = 0.5;
  EXPECT_FALSE(world.finder.find(world.field, world.input, world.points_m));
}

TEST(FarWay, AnEndlessSearchEnds) {
  Room room(false);  // around the target
  EXPECT_FALSE(room.find({0, 0, 20}, {0, 0, 0}));
}

}  // namespace
}  // namespace sightline::test
