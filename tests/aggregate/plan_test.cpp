#include "server/sample/plan.h"

#include <gtest/gtest.h>

#include "server/base/random.h"

namespace sightline {
namespace {

Bound ball(const glm::dvec3& center, double radius) {
  Bound bound;
  bound.center_m = center;
  bound.radius_m = radius;
  return bound;
}

// Every point of the ball is in some window at any distance, also for eyes inside the ball and on its surface.
TEST(Plan, ViewsTogetherShowEveryPointOfTheBall) {
  CounterRandom random(31, 0, RandomPurpose::kTest);
  for (int trial = 0; trial < 3000; ++trial) {
    const Bound bound = ball({random.next_in(-9, 9), random.next_in(-9, 9), random.next_in(-9, 9)},
                             random.next_in(0.1, 3));
    const glm::dvec3 direction(random.next_in(-1, 1), random.next_in(-1, 1), random.next_in(-1, 1));
    const glm::dvec3 eye = bound.center_m + glm::normalize(direction) * (bound.radius_m * random.next_in(0.0, 4.0));
    std::vector<MapView> views;
    const int count = plan_views(eye, bound, {}, {0.5, 0.5}, views);
    ASSERT_EQ(static_cast<size_t>(count), views.size());
    for (int i = 0; i < 50; ++i) {
      const glm::dvec3 d(random.next_in(-1, 1), random.next_in(-1, 1), random.next_in(-1, 1));
      if (glm::length(d) > 1) continue;
      const glm::dvec3 p = bound.center_m + d * bound.radius_m;
      if (glm::distance(p, eye) < 1e-3) continue;
      int seen = 0;
      for (const MapView& view : views) seen += project(view, p).in_window;
      ASSERT_GE(seen, 1) << "eye at " << glm::distance(eye, bound.center_m) / bound.radius_m << " radii";
    }
  }
}

TEST(Plan, OneFrustumFarAwayAndCubeFacesNear) {
  std::vector<MapView> views;
  EXPECT_EQ(plan_views({0, 0, 10}, ball({0, 0, 0}, 1), {}, {0.5, 0.5}, views), 1);
  views.clear();
  EXPECT_GT(plan_views({0, 0, 1.1}, ball({0, 0, 0}, 1), {}, {0.5, 0.5}, views), 1);
  views.clear();
  EXPECT_EQ(plan_views({0, 0, 0.2}, ball({0, 0, 0}, 1), {}, {0.5, 0.5}, views), 6);
}

// The texels of a cube face are about as wide as the texels of the widest single frustum.
TEST(Plan, FacesAreAsFineAsTheWidestFrustum) {
  for (int resolution = kLeastResolution; resolution <= kMaxMapSize; ++resolution) {
    std::vector<MapView> one, faces;
    ASSERT_EQ(plan_views({0, 0, 1 / std::sin(kMaxHalfAngleRad) + 1e-9}, ball({0, 0, 0}, 1), {.resolution = resolution},
                         {0.5, 0.5}, one),
              1);
    ASSERT_GT(plan_views({0, 0, 0.3}, ball({0, 0, 0}, 1), {.resolution = resolution}, {0.5, 0.5}, faces), 1);
    const double widest = (one[0].right - one[0].left) / one[0].width,
                 of_face = (faces[0].right - faces[0].left) / faces[0].width;
    EXPECT_LE(of_face, 1.16 * widest) << resolution;
    EXPECT_GE(faces[0].width, kLeastResolution);
    if (faces[0].width > kLeastResolution) {
      EXPECT_GE(of_face, 0.8 * widest) << resolution;
    }
  }
}

TEST(Plan, RoundViewsShowEveryDirectionOnce) {
  CounterRandom random(33, 0, RandomPurpose::kTest);
  std::vector<MapView> views;
  plan_round({3, -1, 2}, 5, {0.5, 0.5}, views);
  ASSERT_EQ(views.size(), 6u);
  for (int i = 0; i < 1000; ++i) {
    const glm::dvec3 d(random.next_in(-1, 1), random.next_in(-1, 1), random.next_in(-1, 1));
    int seen = 0;
    for (const MapView& view : views) seen += project(view, view.eye_m + d).in_window;
    EXPECT_EQ(seen, 1);
  }
}

TEST(Plan, ATexelShowsWhatItsRayHits) {
  CounterRandom random(32, 0, RandomPurpose::kTest);
  std::vector<MapView> views;
  plan_views({1, 2, 3}, ball({4, 1, -2}, 1.2), {.resolution = 9}, {0.2, 0.9}, views);
  for (int y = 0; y < 9; ++y)
    for (int x = 0; x < 9; ++x) {
      const MapPoint at = project(views[0], views[0].eye_m + texel_direction(views[0], x, y) * random.next_in(0.1, 20));
      EXPECT_TRUE(at.in_window);
      EXPECT_NEAR(at.x, x + 0.2, 1e-9);
      EXPECT_NEAR(at.y, y + 0.9, 1e-9);
    }
}

}  // namespace
}  // namespace sightline
