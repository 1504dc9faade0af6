#include "server/scene/clearance.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "server/scene/primitives.h"
#include "tests/support/triangle_soup.h"

namespace sightline {
namespace {

using namespace test;

void fill_at_random(SceneMirror& mirror, Draw& draw) {
  for (uint64_t id = 1; id <= 6; ++id) {
    NewInstance made = placed(id, random_soup(draw, 150), {draw.vec(4), draw.rotation()});
    if (id % 2 == 0) made.linear = draw.linear();
    add(mirror, std::move(made));
  }
}

// --- The reference: every triangle, by another formula. ---

double distance_to_segment(const glm::dvec3& p, const glm::dvec3& a, const glm::dvec3& b) {
  const double t = glm::dot(p - a, b - a) / glm::dot(b - a, b - a);
  return glm::distance(p, a + (b - a) * std::clamp(t, 0.0, 1.0));
}

double distance_to_triangle(const glm::dvec3& p, const Triangle& t) {
  const glm::dvec3 n = glm::normalize(glm::cross(t[1] - t[0], t[2] - t[0]));
  bool above = true;
  double edges = INFINITY;
  for (int i = 0; i < 3; ++i) {
    const glm::dvec3 &a = t[i], &b = t[(i + 1) % 3];
    above = above && glm::dot(glm::cross(b - a, p - a), n) >= 0;
    edges = std::min(edges, distance_to_segment(p, a, b));
  }
  return above ? std::abs(glm::dot(p - t[0], n)) : edges;
}

double reference_distance(const std::vector<Triangle>& triangles, const glm::dvec3& p) {
  double best = INFINITY;
  for (const Triangle& t : triangles) best = std::min(best, distance_to_triangle(p, t));
  return best;
}

// The triangles that a sphere on the path could touch; this keeps the dense sampling quick.
std::vector<Triangle> near_path(const std::vector<Triangle>& triangles, const glm::dvec3& from, const glm::dvec3& to,
                                double reach) {
  std::vector<Triangle> near;
  for (const Triangle& t : triangles) {
    const glm::dvec3 low = glm::min(t[0], glm::min(t[1], t[2])) - reach,
                     high = glm::max(t[0], glm::max(t[1], t[2])) + reach;
    if (glm::all(glm::lessThan(low, glm::max(from, to))) && glm::all(glm::greaterThan(high, glm::min(from, to))))
      near.push_back(t);
  }
  return near;
}

ClearanceField gathered(const SceneMirror& mirror, std::vector<uint32_t> ignored = {}) {
  ClearanceField field;
  field.gather(mirror, {0, 0, 0}, 1000, ignored);
  return field;
}

TEST(ClosestOnTriangle, AgreesWithAnotherFormulaAndLiesOnTheTriangle) {
  Draw draw(1);
  for (int i = 0; i < 20'000; ++i) {
    Triangle t{draw.vec(1), draw.vec(1), draw.vec(1)};
    if (i % 4 == 0) t[2] = t[0] + (t[1] - t[0]) * draw.in(-1, 2) + draw.vec(1e-7);  // a needle
    const glm::dvec3 p = draw.vec(2), q = closest_on_triangle(p, t[0], t[1], t[2]);
    EXPECT_NEAR(glm::distance(p, q), distance_to_triangle(p, t), 1e-9);
    EXPECT_LT(distance_to_triangle(q, t), 1e-7);
  }
}

TEST(ClosestOnTriangle, ATriangleWithoutAreaIsASegmentOrAPoint) {
  const glm::dvec3 a(0, 0, 0), b(1, 0, 0), c(3, 0, 0);
  EXPECT_EQ(closest_on_triangle({2, 1, 0}, a, b, c), glm::dvec3(2, 0, 0));
  EXPECT_EQ(closest_on_triangle({2, 1, 0}, a, a, a), a);
}

TEST(Clearance, EqualsTheDistanceToEveryTriangleUnderAnyTransform) {
  for (uint64_t seed = 1; seed <= 10; ++seed) {
    Draw draw(seed);
    SceneMirror mirror;
    fill_at_random(mirror, draw);
    const auto triangles = world_triangles(mirror);
    const ClearanceField field = gathered(mirror);
    for (int i = 0; i < 60; ++i) {
      const glm::dvec3 p = draw.vec(i % 2 ? 6 : 15);
      const double expected = reference_distance(triangles, p);
      EXPECT_NEAR(field.clearance_m(p, 100), expected, 1e-9);
      glm::dvec3 surface;
      ASSERT_TRUE(field.nearest(p, 100, surface));
      EXPECT_NEAR(glm::distance(p, surface), expected, 1e-9);
      EXPECT_LT(reference_distance(triangles, surface), 1e-9);
    }
  }
}

// The reference sweeps each collider by itself.
TEST(Clearance, TheFirstInTheWayIsTheOneThatStopsASphereSoonest) {
  int blocked = 0, clear = 0;
  for (uint64_t seed = 1; seed <= 6; ++seed) {
    Draw draw(seed);
    SceneMirror mirror;
    fill_at_random(mirror, draw);
    const ClearanceField field = gathered(mirror);
    std::vector<ClearanceField> alone;
    for (uint32_t slot = 0; slot < 6; ++slot) {
      std::vector<uint32_t> others;
      for (uint32_t other = 0; other < 6; ++other)
        if (other != slot) others.push_back(other);
      alone.push_back(gathered(mirror, others));
    }
    for (int i = 0; i < 40; ++i) {
      const glm::dvec3 from = draw.vec(15), to = draw.vec(15);
      std::optional<uint32_t> expected;
      double least = 1.0;
      for (uint32_t slot = 0; slot < 6; ++slot)
        if (const double free = alone[slot].free_fraction(from, to, 0.05); free < least) least = free, expected = slot;
      EXPECT_EQ(field.first_in_way(from, to, 0.05), expected);
      ++(expected ? blocked : clear);
    }
  }
  EXPECT_GT(blocked, 20);
  EXPECT_GT(clear, 20);
}

TEST(Clearance, IsTheReachWhenNothingIsNearer) {
  SceneMirror mirror;
  add(mirror, placed(1, build_geometry(tessellate(BoxShape{}).value()).value()));
  const ClearanceField field = gathered(mirror);
  glm::dvec3 untouched(7);
  EXPECT_EQ(field.clearance_m({3, 0, 0}, 2.0), 2.0);
  EXPECT_FALSE(field.nearest({3, 0, 0}, 2.0, untouched));
  EXPECT_EQ(untouched, glm::dvec3(7));
  EXPECT_DOUBLE_EQ(field.clearance_m({3, 0, 0}, 3.0), 2.5);
  EXPECT_EQ(ClearanceField().clearance_m({0, 0, 0}, 5.0), 5.0);
}

TEST(Clearance, OnlyCollidersWithinReachAndNotIgnoredAreGathered) {
  const auto box = build_geometry(tessellate(BoxShape{}).value()).value();
  SceneMirror mirror;
  NewInstance hidden = placed(2, box), ghost = placed(3, box), glass = placed(4, box, {{0, 5, 0}, {1, 0, 0, 0}});
  hidden.attributes.visible = false;
  ghost.attributes.collides = false;
  glass.attributes.opacity = 0.1f;
  glass.attributes.occludes = false;
  for (const NewInstance& i : {placed(1, box, {{100, 0, 0}, {1, 0, 0, 0}}), hidden, ghost, glass}) add(mirror, i);
  ClearanceField field;
  field.gather(mirror, {0, 0, 0}, 10, {});
  EXPECT_EQ(field.collider_count(), 1u);
  EXPECT_DOUBLE_EQ(field.clearance_m({0, 0, 0}, 10), 4.5);  // glass stops a camera
  const std::vector<uint32_t> ignored = {*mirror.slot_of(4)};
  field.gather(mirror, {0, 0, 0}, 10, ignored);
  EXPECT_EQ(field.collider_count(), 0u);
  field.gather(mirror, {0, 0, 0}, 99.6, ignored);  // reaches the far box's sphere
  EXPECT_EQ(field.collider_count(), 1u);
}

// Static geometry is kept from one gather to the next. A field that follows the camera must equal a fresh one after
// every change on the way.
TEST(Clearance, AFieldThatGoesAlongIsAFreshOne) {
  const auto box = build_geometry(tessellate(BoxShape{}).value()).value();
  for (uint64_t seed = 0; seed < 10; ++seed) {
    Draw draw(seed);
    SceneMirror mirror;
    for (uint64_t id = 1; id <= 60; ++id) {
      NewInstance made = placed(id, box, {draw.vec(25), draw.rotation()});
      made.moving = id % 5 == 0;
      add(mirror, std::move(made));
    }
    ClearanceField along;
    glm::dvec3 at(0.0);
    for (int step = 0; step < 60; ++step) {
      at += step % 20 == 19 ? draw.vec(20) : draw.vec(0.4);
      SceneDelta delta;
      if (step % 15 == 7) delta.change.push_back({static_cast<uint64_t>(1 + step), {.collides = false}});
      if (step % 15 == 11) delta.remove.push_back(static_cast<uint64_t>(1 + step));
      TransformUpdate update;
      update.ids = {5, step == 30 ? uint64_t{2} : uint64_t{10}};  // an instance that was static begins to move
      update.poses = {{draw.vec(10), draw.rotation()}, {draw.vec(10), draw.rotation()}};
      ASSERT_TRUE(mirror.apply(delta, update));
      std::vector<uint32_t> ignored;
      if (step % 7 == 3) ignored = {*mirror.slot_of(1)};
      if (step % 7 == 5) ignored.assign(mirror.moving_slots().begin(), mirror.moving_slots().end());
      ClearanceField fresh;
      along.gather(mirror, at, 8, ignored);
      fresh.gather(mirror, at, 8, ignored);
      ASSERT_EQ(along.collider_count(), fresh.collider_count()) << "seed " << seed << " step " << step;
      const ClearanceField copy = along;
      for (int k = 0; k < 10; ++k) {
        const glm::dvec3 p = at + draw.vec(3), q = at + draw.vec(3);
        ASSERT_EQ(copy.clearance_m(p, 2), fresh.clearance_m(p, 2));
        ASSERT_EQ(copy.free_fraction(p, q, 0.3), fresh.free_fraction(p, q, 0.3));
      }
    }
  }
}

// Static geometry is gathered farther than it is needed. A camera that goes on must not outrun it.
TEST(Clearance, AFieldThatTravelsFarIsAFreshOneAllTheWay) {
  Draw draw(4);
  SceneMirror mirror;
  const auto box = build_geometry(tessellate(BoxShape{}).value()).value();
  for (uint64_t id = 1; id <= 300; ++id)
    add(mirror, placed(id, box, {glm::dvec3(0.1 * static_cast<double>(id), 0, 0) + draw.vec(6), draw.rotation()}));
  ClearanceField along;
  for (int step = 0; step < 120; ++step) {
    const glm::dvec3 at(0.2 * step, 0, 0);
    ClearanceField fresh;
    along.gather(mirror, at, 3, {});
    fresh.gather(mirror, at, 3, {});
    ASSERT_EQ(along.collider_count(), fresh.collider_count()) << "after " << at.x << " m";
    for (int k = 0; k < 5; ++k) {
      const glm::dvec3 p = at + draw.vec(2);
      ASSERT_EQ(along.clearance_m(p, 1), fresh.clearance_m(p, 1)) << "after " << at.x << " m";
    }
  }
}

TEST(Clearance, FarFromTheOriginItStaysExact) {
  SceneMirror mirror;
  add(mirror, placed(1, build_geometry(tessellate(BoxShape{}).value()).value(), {{50'000, 0, -50'000}, {1, 0, 0, 0}}));
  ClearanceField field;
  field.gather(mirror, {50'000, 0, -50'000}, 10, {});
  EXPECT_NEAR(field.clearance_m({50'001, 0, -50'000}, 10), 0.5, 1e-10);
}

TEST(Sweep, NeverGoesTooFarAndStopsAtMostAMillimetreShort) {
  int stopped = 0, free = 0;
  for (uint64_t seed = 1; seed <= 50; ++seed) {
    Draw draw(100 + seed);
    SceneMirror mirror;
    fill_at_random(mirror, draw);
    const auto all = world_triangles(mirror);
    const ClearanceField field = gathered(mirror);
    size_t blocker = seed % 2 * 1000;  // none at first, or an instance that never existed
    for (int i = 0; i < 40; ++i) {
      const double radius = i % 5 == 0 ? 0.0 : draw.in(0.01, 0.5);
      const glm::dvec3 from = draw.vec(7), to = from + draw.vec(i % 2 ? 6 : 0.5);
      const double length = glm::distance(from, to), fraction = field.free_fraction(from, to, radius);
      ASSERT_TRUE(fraction >= 0 && fraction <= 1);
      EXPECT_EQ(field.is_free(from, to, radius, blocker), fraction >= 1);
      const auto triangles = near_path(all, from, to, radius + 0.1);
      const auto distance_at = [&](double t) { return reference_distance(triangles, glm::mix(from, to, t)); };
      if (distance_at(0) < radius) {
        EXPECT_EQ(fraction, 0.0);
        continue;
      }
      for (int k = 0; k <= 300; ++k) EXPECT_GE(distance_at(fraction * k / 300), radius - 2e-9);
      ++(fraction < 1 ? stopped : free);
      if (fraction == 1) continue;
      double closest = INFINITY;  // somewhere in the next millimetre it touches
      for (int k = 0; k <= 40; ++k) closest = std::min(closest, distance_at(fraction + 0.001 * k / 40 / length));
      EXPECT_LE(closest, radius + 2.5e-5);
    }
  }
  EXPECT_GT(stopped, 100);  // both outcomes were really tried
  EXPECT_GT(free, 100);
}

// Each of many colliders blocks exactly where it stands: 300 posts on a circle, with more than the sphere's width
// between them.
TEST(Sweep, MeetsEachOfManyAndPassesBetween) {
  constexpr int kPosts = 300;
  constexpr double kRingM = 40.0, kTurn = 2 * 3.14159265358979323846 / kPosts;
  const auto on_circle = [](double turns, double radius_m) {
    return glm::dvec3(radius_m * std::cos(kTurn * turns), 0.0, radius_m * std::sin(kTurn * turns));
  };
  const auto post = build_geometry(tessellate(BoxShape{{0.05f, 2.0f, 0.05f}}).value()).value();
  SceneMirror mirror;
  for (int i = 0; i < kPosts; ++i) {
    NewInstance instance = placed(static_cast<uint64_t>(i + 1), post);
    instance.pose.position_m = on_circle(i, kRingM);
    add(mirror, std::move(instance));
  }
  const ClearanceField field = gathered(mirror);
  for (int i = 0; i < kPosts; ++i) {
    size_t any = 0, blocker = 0;
    EXPECT_FALSE(field.is_free({0, 0, 0}, on_circle(i, kRingM + 1), 0.2, blocker)) << i;
    EXPECT_EQ(blocker, static_cast<size_t>(i));
    EXPECT_FALSE(field.is_free({0, 0, 0}, on_circle(i, kRingM + 2), 0.2, blocker)) << i;
    EXPECT_TRUE(field.is_free({0, 0, 0}, on_circle(i, kRingM - 0.5), 0.2, blocker)) << i;
    EXPECT_TRUE(field.is_free({0, 0, 0}, on_circle(i + 0.5, kRingM + 1), 0.2, any)) << i;
    EXPECT_LT(field.clearance_m(on_circle(i, kRingM - 0.5), 1.0), 0.5) << i;
  }
}

// With less and less allowed, each answer is either exact or the careful one, and never another.
TEST(Clearance, BeyondTheAllowanceTheAnswersAreCareful) {
  Draw draw(77);
  SceneMirror mirror;
  fill_at_random(mirror, draw);
  const ClearanceField free = gathered(mirror), bounded = gathered(mirror);
  size_t exact = 0, careful = 0;
  for (int i = 0; i < 200; ++i) {
    const glm::dvec3 from = draw.vec(7), to = from + draw.vec(4);
    size_t blocker = ClearanceField::kNoBlocker;
    bounded.allow(1 + static_cast<uint64_t>(i) * 7);
    const double clearance_m = bounded.clearance_m(from, 3);
    EXPECT_EQ(clearance_m, bounded.exhausted() ? 0.0 : free.clearance_m(from, 3));
    ++(bounded.exhausted() ? careful : exact);
    bounded.allow(1 + static_cast<uint64_t>(i) * 7);
    const double fraction = bounded.free_fraction(from, to, 0.2);
    EXPECT_EQ(fraction, bounded.exhausted() ? 0.0 : free.free_fraction(from, to, 0.2));
    bounded.allow(1 + static_cast<uint64_t>(i) * 7);
    EXPECT_LE(bounded.is_free(from, to, 0.2, blocker), free.free_fraction(from, to, 0.2) >= 1);
    bounded.allow(1 + static_cast<uint64_t>(i) * 7);
    EXPECT_LE(bounded.is_inside(from), free.is_inside(from));
    EXPECT_LE(bounded.tests(), 1 + static_cast<uint64_t>(i) * 7);
  }
  EXPECT_GT(exact, 20u);
  EXPECT_GT(careful, 20u);
}

// The count of a query depends on the mirror and on the query, not on the way on which the field came there.
TEST(Clearance, TheCountDoesNotDependOnWhatWasGatheredBefore) {
  Draw draw(78);
  SceneMirror mirror;
  fill_at_random(mirror, draw);
  ClearanceField along;
  for (int i = 0; i < 30; ++i) {
    const glm::dvec3 at(-3 + 0.2 * i, 0, 0);
    along.gather(mirror, at, 4, {});
    ClearanceField fresh;
    fresh.gather(mirror, at, 4, {});
    for (int k = 0; k < 20; ++k) {
      const glm::dvec3 from = at + draw.vec(1), to = at + draw.vec(1);
      size_t one = ClearanceField::kNoBlocker, other = ClearanceField::kNoBlocker;
      along.is_free(from, to, 0.1, one), fresh.is_free(from, to, 0.1, other);
      along.clearance_m(from, 1), fresh.clearance_m(from, 1);
      ASSERT_EQ(along.tests(), fresh.tests()) << i;
    }
  }
}

// A room's wall: the plane x = 0, 40 m wide.
class WallTest : public ::testing::Test {
 protected:
  WallTest() {
    MeshData wall;
    wall.positions = {{0, -20, -20}, {0, 20, -20}, {0, 20, 20}, {0, -20, 20}};
    wall.indices = {0, 1, 2, 0, 2, 3};
    add(mirror, placed(1, build_geometry(wall).value()));
    field.gather(mirror, {0, 0, 0}, 100, {});
  }
  SceneMirror mirror;
  ClearanceField field;
};

TEST_F(WallTest, AHeadOnMoveStopsAtContact) {
  EXPECT_NEAR(field.free_fraction({2, 0, 0}, {-2, 0, 0}, 0.3) * 4, 1.7, 1e-6);
  EXPECT_NEAR(field.free_fraction({-2, 0, 0}, {2, 0, 0}, 0.3) * 4, 1.7, 1e-6);  // both sides alike
}

TEST_F(WallTest, NoSpeedTunnelsThrough) {
  EXPECT_NEAR(field.free_fraction({50, 0, 0}, {-50, 0, 0}, 1e-3) * 100, 50 - 1e-3, 1e-6);
  EXPECT_NEAR(field.free_fraction({50, 1, 2}, {-50, 1, 2}, 0.0) * 100, 50, 1e-6);
}

TEST_F(WallTest, AMoveAlongTheWallIsFreeHoweverNarrowTheGap) {
  for (const double gap : {0.1, 1e-3, 1e-6, 1e-10, 0.0})
    EXPECT_EQ(field.free_fraction({0.3 + gap, 0, -10}, {0.3 + gap, 0, 10}, 0.3), 1.0) << gap;
}

TEST_F(WallTest, AThousandSlidesInContactNeverGetStuck) {
  Draw draw(5);
  const double fraction = field.free_fraction({2, 0.1, 0.2}, {-2, 0.3, -0.1}, 0.3);
  glm::dvec3 p = glm::mix(glm::dvec3(2, 0.1, 0.2), glm::dvec3(-2, 0.3, -0.1), fraction);
  for (int i = 0; i < 1000; ++i) {
    const glm::dvec3 next(p.x, draw.in(-15, 15), draw.in(-15, 15));
    ASSERT_EQ(field.free_fraction(p, next, 0.3), 1.0) << i;
    p = next;
  }
}

TEST_F(WallTest, AShallowApproachStopsWhereItTouches) {
  // The gap between the sphere and the wall falls from 1 mm to -1 mm over 20 m: contact is in the middle.
  const double stop = field.free_fraction({0.301, 0, -10}, {0.299, 0, 10}, 0.3) * 20;
  EXPECT_LE(stop, 10 + 1e-9);
  EXPECT_GE(stop, 10 - 1e-3);
}

TEST_F(WallTest, FromContactItMaySlideAndLeaveButNotPress) {
  const double fraction = field.free_fraction({2, 0, 0}, {-2, 0, 0}, 0.3);
  const glm::dvec3 contact(2 - 4 * fraction, 0, 0);
  EXPECT_EQ(field.free_fraction(contact, contact + glm::dvec3(1, 0, 0), 0.3), 1.0);
  EXPECT_EQ(field.free_fraction(contact, contact + glm::dvec3(0, 1, 1), 0.3), 1.0);
  EXPECT_LT(field.free_fraction(contact, contact - glm::dvec3(1, 0, 0), 0.3), 1e-6);
}

TEST_F(WallTest, AnOverlapIsNeverFree) {
  EXPECT_EQ(field.free_fraction({0.2, 0, 0}, {5, 0, 0}, 0.3), 0.0);
  EXPECT_EQ(field.free_fraction({0.2, 0, 0}, {0.2, 0, 0}, 0.3), 0.0);
}

TEST_F(WallTest, NoMoveIsFreeWhereThereIsRoom) {
  EXPECT_EQ(field.free_fraction({1, 0, 0}, {1, 0, 0}, 0.3), 1.0);
}

TEST(Sweep, NothingInTheWayIsFree) {
  EXPECT_EQ(ClearanceField().free_fraction({0, 0, 0}, {9, 9, 9}, 1.0), 1.0);
}

}  // namespace
}  // namespace sightline
