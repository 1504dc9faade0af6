#include "server/aggregate/pair_volume.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "server/aggregate/compose.h"
#include "server/base/random.h"
#include "tests/aggregate/random_ball.h"

namespace sightline {
namespace {

struct Configuration {
  glm::dvec3 a, b;
  Bound bound;
};

// Random until complete: targets 0.5 to 6 m apart, the ball anywhere around.
Configuration random_complete(CounterRandom& random) {
  for (;;) {
    Configuration c;
    c.a = random_vector(random, 20);
    c.b = c.a + random_vector(random, 3);
    c.bound = ball(c.a + random_vector(random, 8), random.next_in(0.1, 1.5));
    if (pair_gap(c.a, c.b, c.bound) == PairGap::kNone) return c;
  }
}

double distance_to_line(const glm::dvec3& p, const glm::dvec3& from, const glm::dvec3& direction) {
  return glm::length(glm::cross(p - from, direction)) / glm::length(direction);
}

glm::dvec3 random_inside(CounterRandom& random, const Bound& bound) {
  for (;;) {
    const glm::dvec3 p = bound.center_m + random_vector(random, bound.radius_m);
    if (bound.contains(p)) return p;
  }
}

TEST(PairVolume, RaysOfEqualRowsMeetAtTheClosedFormPoint) {
  CounterRandom random(11, 0, RandomPurpose::kTest);
  for (int trial = 0; trial < 2000; ++trial) {
    const Configuration c = random_complete(random);
    const PairVolume volume = make_pair_volume(c.a, c.b, c.bound, 7);
    const auto views = pair_views(volume, {0.5, 0.5});
    const int xa = random.next_below(7), xb = random.next_below(7), y = random.next_below(7);
    const glm::dvec3 point =
        meet(volume, column_of_a(volume, xa + 0.5), column_of_b(volume, xb + 0.5), row(volume, y + 0.5));
    // Checked against the two rays that the maps define, not against the formula.
    const double scale = glm::distance(point, c.a) + glm::distance(point, c.b);
    EXPECT_LT(distance_to_line(point, c.a, texel_direction(views[0], xa, y)), 1e-6 * scale);
    EXPECT_LT(distance_to_line(point, c.b, texel_direction(views[1], xb, y)), 1e-6 * scale);
  }
}

TEST(PairVolume, CoordinatesInvertTheMeetingPoint) {
  CounterRandom random(12, 0, RandomPurpose::kTest);
  for (int trial = 0; trial < 2000; ++trial) {
    const Configuration c = random_complete(random);
    const PairVolume volume = make_pair_volume(c.a, c.b, c.bound, 7);
    const glm::dvec3 point = random_inside(random, c.bound);
    const PairCoordinates at = pair_coordinates(volume, point);
    EXPECT_LT(glm::distance(meet(volume, at.xa, at.xb, at.y), point), 1e-6 * glm::distance(point, c.a));
  }
}

TEST(PairVolume, BothMapsShowEveryPointOfTheBallInTheSameRow) {
  CounterRandom random(13, 0, RandomPurpose::kTest);
  for (int trial = 0; trial < 2000; ++trial) {
    const Configuration c = random_complete(random);
    const auto views = pair_views(make_pair_volume(c.a, c.b, c.bound, 7), {0.5, 0.5});
    const glm::dvec3 point = random_inside(random, c.bound);
    const MapPoint in_a = project(views[0], point), in_b = project(views[1], point);
    ASSERT_TRUE(in_a.in_window && in_b.in_window);
    EXPECT_NEAR(in_a.y, in_b.y, 1e-6 * 7);
  }
}

TEST(PairVolume, WindowsAreTightAroundTheBall) {
  CounterRandom random(14, 0, RandomPurpose::kTest);
  const Configuration c = random_complete(random);
  const PairVolume volume = make_pair_volume(c.a, c.b, c.bound, 7);
  double low = 1e9, high = -1e9, top = -1e9;
  for (int i = 0; i < 200000; ++i) {
    const glm::dvec3 p = c.bound.center_m + glm::normalize(random_vector(random, 1)) * c.bound.radius_m;
    const PairCoordinates at = pair_coordinates(volume, p);
    low = std::min(low, at.xa), high = std::max(high, at.xa), top = std::max(top, at.y);
  }
  const double width = volume.xa_max - volume.xa_min;
  EXPECT_NEAR(low, volume.xa_min, 0.01 * width);
  EXPECT_NEAR(high, volume.xa_max, 0.01 * width);
  EXPECT_NEAR(top, volume.y_top, 0.01 * volume.y_top);
}

// The definition by brute force, in the plane through the line AB and the centre. Every ray of A inside its window must
// meet every ray of B inside B's window, in front of both.
TEST(PairVolume, CompletenessAgreesWithTracingTheOutermostRays) {
  CounterRandom random(15, 0, RandomPurpose::kTest);
  int complete = 0, incomplete = 0;
  for (int trial = 0; trial < 5000; ++trial) {
    const glm::dvec3 a(0, 0, 0), b(random.next_in(0.2, 4), 0, 0);
    const glm::dvec3 center(random.next_in(-3, 6), 0, random.next_in(0.3, 6));
    const double radius = random.next_in(0.05, 2.0);
    const Bound bound = ball(center, radius);
    if (radius >= center.z) continue;  // the ball touches the line, which is a case of its own
    // The outermost rays: A's tangent on the side away from B, and B's on the side away from A.
    const auto tangent = [&](const glm::dvec3& eye, double side) {
      const glm::dvec3 to = center - eye;
      return std::atan2(to.x, to.z) + side * std::asin(radius / glm::length(to));
    };
    const double ray_a = tangent(a, -1), ray_b = tangent(b, +1);  // angles from +z towards +x
    const bool meets = std::sin(ray_a - ray_b) > 0;  // A's ray leans more towards B than B's does away
    EXPECT_EQ(pair_gap(a, b, bound) == PairGap::kNone, meets);
    ++(meets ? complete : incomplete);
  }
  EXPECT_GT(complete, 500);
  EXPECT_GT(incomplete, 500);
}

TEST(PairVolume, FrontalTwoShotIsCompleteUpToHalfTheTargetsDistance) {
  const glm::dvec3 a(-1, 0, 0), b(1, 0, 0);
  EXPECT_EQ(pair_gap(a, b, ball({0, 0, 50}, 0.99)), PairGap::kNone);
  EXPECT_EQ(pair_gap(a, b, ball({0, 0, 50}, 1.01)), PairGap::kTooClose);
}

TEST(PairVolume, NamesEachIncompleteCase) {
  const glm::dvec3 a(-1, 0, 0), b(1, 0, 0);
  EXPECT_EQ(pair_gap(a, a + glm::dvec3(0.1, 0, 0), ball({0, 0, 5}, 0.5)), PairGap::kTooClose);  // close pair
  EXPECT_EQ(pair_gap(a, a, ball({0, 0, 5}, 0.5)), PairGap::kTooClose);                          // same place
  EXPECT_EQ(pair_gap(a, b, ball({-3, 0.2, 0}, 0.5)), PairGap::kOnLine);          // over the shoulder
  EXPECT_EQ(pair_gap(a, b, ball({0, 0.1, 0.1}, 0.5)), PairGap::kOnLine);         // between the targets
  EXPECT_EQ(pair_gap(a, b, ball({5, 0, 0}, 0.5)), PairGap::kOnLine);             // on the line AB
  // Beside the line, but the rays from the far target could not be told from it.
  EXPECT_EQ(pair_gap(a, {8e8, 0, 0}, ball({0, 0, 5}, 0.5)), PairGap::kOnLine);
  EXPECT_EQ(pair_gap(a, {8e5, 0, 0}, ball({0, 0, 5}, 0.5)), PairGap::kNone);
  EXPECT_EQ(pair_gap(a, b, ball({1.2, 0.1, 0}, 0.5)), PairGap::kTargetInBound);  // a target in the ball
}

// The paper's map I_AB from [u v w], each in [0, 1], to the world: u along B's columns, v along rows, 1 - w along A's
// columns.
glm::dvec3 printed_trilinear(const PairVolume& volume, double u, double v, double w) {
  const auto corner = [&](int iu, int iv, int iw) {
    return meet(volume, iw ? volume.xa_min : volume.xa_max, iu ? volume.xb_max : volume.xb_min,
                iv ? -volume.y_top : volume.y_top);
  };
  const glm::dvec3 origin = corner(0, 0, 0);
  const glm::dvec3 i = corner(1, 0, 0) - origin;
  const glm::dvec3 j1 = corner(0, 1, 0) - origin, j2 = corner(1, 1, 0) - corner(1, 0, 0);
  const glm::dvec3 k1 = corner(0, 0, 1) - origin, k2 = corner(0, 1, 1) - corner(0, 1, 0);
  const glm::dvec3 k3 = corner(1, 1, 1) - corner(1, 1, 0), k4 = corner(1, 0, 1) - corner(1, 0, 0);
  return origin + u * i + v * ((1 - u) * j1 + u * j2) +
         w * ((1 - u) * ((1 - v) * k1 + v * k2) + u * ((1 - v) * k4 + v * k3));
}

// With L = 2 m at 5 m and radius 0.5 m, equal pixel steps and the printed trilinear map part by more than a cell.
TEST(PairVolume, PrintedTrilinearMapAgreesAtTheCornersOnly) {
  const PairVolume volume = make_pair_volume({-1, 0, 0}, {1, 0, 0}, ball({0, 0, 5}, 0.5), 7);
  const auto closed_form = [&](double u, double v, double w) {
    return meet(volume, column_of_a(volume, 7 * (1 - w)), column_of_b(volume, 7 * u), row(volume, 7 * v));
  };
  for (const double u : {0.0, 1.0})
    for (const double v : {0.0, 1.0})
      for (const double w : {0.0, 1.0})
        EXPECT_LT(glm::distance(printed_trilinear(volume, u, v, w), closed_form(u, v, w)), 1e-9);

  double sum = 0;
  int count = 0;
  for (int u = 0; u < 7; ++u)
    for (int v = 0; v < 7; ++v)
      for (int w = 0; w < 7; ++w, ++count)
        sum += glm::distance(printed_trilinear(volume, (u + .5) / 7, (v + .5) / 7, (w + .5) / 7),
                             closed_form((u + .5) / 7, (v + .5) / 7, (w + .5) / 7));
  EXPECT_GT(sum / count, 0.2) << "metres";
}

TEST(PairVolume, CandidatesAreThePointsInTheBallAndCompareAtTheirOwnTexels) {
  CounterRandom random(16, 0, RandomPurpose::kTest);
  const Configuration c = random_complete(random);
  const PairVolume volume = make_pair_volume(c.a, c.b, c.bound, 7);
  const auto views = pair_views(volume, {0.3, 0.8});
  DepthMap map_a{views[0], std::vector<float>(49), std::vector<uint32_t>(49, 0)};
  DepthMap map_b{views[1], std::vector<float>(49), std::vector<uint32_t>(49, 0)};
  for (float& d : map_a.distance_m)
    d = static_cast<float>(random.next_in(0, 2 * glm::distance(c.a, c.bound.center_m)));
  for (float& d : map_b.distance_m)
    d = static_cast<float>(random.next_in(0, 2 * glm::distance(c.b, c.bound.center_m)));
  CandidateSet pair;
  compose_pair(volume, map_a, map_b, c.bound, 0.001, pair);
  ASSERT_GT(pair.size(), 20u);
  // The general operator, which projects, must give the same answer for the same points.
  CandidateSet general;
  for (const auto& p : pair.position_m) {
    EXPECT_TRUE(c.bound.contains(p));
    general.add(p);
  }
  const std::vector<DepthMap> maps = {map_a, map_b};
  const std::vector<MapRange> ranges = {{0, 1}, {1, 1}};
  Composer composer;
  composer.set_positions(general.position_m);
  composer.visibility({maps, ranges, ranges}, 0.001, general.visible_targets);
  EXPECT_EQ(general.visible_targets, pair.visible_targets);
}

// Left and right are the same, so a column that one target's window left out would be missing on one side.
TEST(PairVolume, CandidatesOfASymmetricSceneAreSymmetric) {
  const auto bound = ball({0, 0, 5}, 0.5);
  const PairVolume volume = make_pair_volume({-1, 0, 0}, {1, 0, 0}, bound, 7);
  const auto views = pair_views(volume, {0.5, 0.5});
  const DepthMap map_a{views[0], std::vector<float>(49, 100.0f), std::vector<uint32_t>(49, 0)};
  const DepthMap map_b{views[1], std::vector<float>(49, 100.0f), std::vector<uint32_t>(49, 0)};
  CandidateSet pair;
  compose_pair(volume, map_a, map_b, bound, 0.001, pair);
  ASSERT_GT(pair.size(), 20u);
  for (const glm::dvec3 p : pair.position_m) {
    double nearest_m = 1e9;
    for (const glm::dvec3 q : pair.position_m) nearest_m = std::min(nearest_m, glm::distance(q, glm::dvec3(-p.x, p.y, p.z)));
    EXPECT_LT(nearest_m, 1e-4) << p.x << ' ' << p.y << ' ' << p.z;
  }
}

}  // namespace
}  // namespace sightline
