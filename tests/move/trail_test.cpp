#include "server/move/trail.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <deque>

#include "server/move/body.h"
#include "tests/support/triangle_soup.h"

namespace sightline {
namespace {

using namespace test;

TEST(Trail, KeepsAPlaceEveryHalfMetre) {
  Trail trail;
  for (int i = 0; i <= 200; ++i) trail.pass({0.01 * i, 0, 0});
  ASSERT_EQ(trail.places_m().size(), 5u);
  for (size_t k = 0; k < 5; ++k) EXPECT_NEAR(trail.places_m()[k].x, 0.5 * static_cast<double>(k), 1e-9);
}

TEST(Trail, StandingStillAddsNothing) {
  Trail trail;
  for (int i = 0; i < 1000; ++i) trail.pass({5 + 0.1 * (i % 2), 1, 2});
  EXPECT_EQ(trail.places_m().size(), 1u);
}

TEST(Trail, AJumpStartsItAnewAndALongStepDoesNot) {
  Trail trail;
  trail.pass({0, 0, 0}), trail.pass({3, 0, 0});
  EXPECT_EQ(trail.places_m().size(), 2u);
  trail.pass({3, 0, 3.01});
  EXPECT_EQ(trail.places_m(), std::vector<glm::dvec3>{glm::dvec3(3, 0, 3.01)});
}

TEST(Trail, ForgetsOnDemand) {
  Trail trail;
  trail.pass({0, 0, 0});
  trail.forget();
  EXPECT_TRUE(trail.places_m().empty());
}

// The last thousand points of a walk, compared with a queue.
TEST(Trail, KeepsTheNewestThousandInOrder) {
  Draw draw(31);
  Trail trail;
  std::deque<glm::dvec3> expected;
  glm::dvec3 at(10'000, 2, -10'000);
  for (int i = 0; i < 8000; ++i) {
    at += draw.vec(0.3);
    trail.pass(at);
    if (expected.empty() || glm::distance(expected.back(), at) >= 0.5) expected.push_back(at);
    if (expected.size() > 1000) expected.pop_front();
    ASSERT_LE(trail.places_m().size(), 1000u);
  }
  EXPECT_TRUE(std::equal(expected.begin(), expected.end(), trail.places_m().begin(), trail.places_m().end()));
}

TEST(Trail, WithoutPlacesThereIsNoWayBack) {
  EXPECT_FALSE(Trail().way_back(ClearanceField(), {0, 0, 0}, 12, 0.3, 0.0));
}

// The newest point that is near enough, far enough from the targets, and reachable without a collision.
TEST(Trail, TheWayBackIsTheNewestOfAllThatCanBeReached) {
  Draw draw(32);
  int found = 0, none = 0, passed_over = 0;
  for (int trial = 0; trial < 200; ++trial) {
    SceneMirror mirror;
    add(mirror, placed(1, random_soup(draw, 30)));
    ClearanceField field;
    field.gather(mirror, {0, 0, 0}, 100, {});
    Trail trail;
    glm::dvec3 at = draw.vec(2);
    for (int i = 0; i < 30; ++i) trail.pass(at += draw.vec(0.5));
    const glm::dvec3 from = draw.vec(2);
    const double reach = draw.in(0.5, 4), body = draw.in(0.02, 0.4), keep_off = draw.in(0, 1.5);
    std::optional<glm::dvec3> expected;
    for (const glm::dvec3& place : trail.places_m())
      if (glm::length(place - from) <= reach && glm::length(place - trail.places_m().back()) >= keep_off &&
          StraightWays(field, from, body).is_free(place))
        expected = place;
    const auto way = trail.way_back(field, from, reach, body, keep_off);
    ASSERT_EQ(way, expected) << "trial " << trial;
    ++(way ? found : none);
    passed_over += way && *way != trail.places_m().back();
  }
  EXPECT_GT(found, 30);
  EXPECT_GT(none, 30);
  EXPECT_GT(passed_over, 30);
}

}  // namespace
}  // namespace sightline
