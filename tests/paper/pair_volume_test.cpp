#include "server/paper/pair_volume.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <tuple>
#include <vector>

#include "server/base/random.h"
#include "tests/aggregate/random_ball.h"

namespace sightline {
namespace {

struct Configuration {
  glm::dvec3 a, b;
  Bound bound;
};

// Random among those that have a volume: targets 0.02 to 9 m apart, the ball anywhere around, larger or smaller than
// what parts them: frontal, over the shoulder, between the targets.
Configuration random_pair(CounterRandom& random) {
  for (;;) {
    Configuration c;
    c.a = random_vector(random, 20);
    c.b = c.a + random_vector(random, random.next_below(2) ? 3 : 0.3);
    c.bound = ball(c.a + random_vector(random, random.next_below(2) ? 8 : 2), random.next_in(0.1, 1.5));
    if (pair_gap(c.a, c.b, c.bound) == PairGap::kNone) return c;
  }
}

// The ball is in front of the line AB with room to spare, and each of its points meets a ray of A and one of B.
bool shows_whole_ball(const PairVolume& volume, const Bound& bound) {
  const glm::dvec3 center = (bound.center_m - volume.a_m) * volume.world_from_volume;
  const auto widest = [&](double x0) {
    const double dx = center.x - x0;
    return std::abs(std::atan2(dx, center.z)) + std::asin(std::min(1.0, bound.radius_m / std::hypot(dx, center.z)));
  };
  return std::max({widest(0), widest(volume.length_m), std::asin(std::min(1.0, bound.radius_m / center.z))}) <
         kWidestRad;
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
    const Configuration c = random_pair(random);
    const PairVolume volume = make_pair_volume(c.a, c.b, c.bound, 7);
    const auto views = pair_views(volume, {0.5, 0.5});
    const int xa = random.next_below(7), xb = random.next_below(7), y = random.next_below(7);
    const glm::dvec3 point = meet(volume, column_of_a(volume, xa + 0.5), column_of_b(volume, xb + 0.5),
                                  row(volume, y + 0.5));
    // Checked against the two rays that the maps define, not against the formula.
    const double scale = glm::distance(point, c.a) + glm::distance(point, c.b);
    EXPECT_LT(distance_to_line(point, c.a, texel_direction(views[0], xa, y)), 1e-6 * scale);
    EXPECT_LT(distance_to_line(point, c.b, texel_direction(views[1], xb, y)), 1e-6 * scale);
  }
}

TEST(PairVolume, CoordinatesInvertTheMeetingPoint) {
  CounterRandom random(12, 0, RandomPurpose::kTest);
  for (int trial = 0; trial < 2000; ++trial) {
    const Configuration c = random_pair(random);
    const PairVolume volume = make_pair_volume(c.a, c.b, c.bound, 7);
    const glm::dvec3 point = random_inside(random, c.bound);
    if (glm::dot(point - c.a, volume.world_from_volume[2]) < 1e-3) continue;  // behind both targets, or beside them
    const PairCoordinates at = pair_coordinates(volume, point);
    EXPECT_LT(glm::distance(meet(volume, at.xa, at.xb, at.y), point), 1e-6 * glm::distance(point, c.a));
  }
}

TEST(PairVolume, BothMapsShowEveryPointOfTheBallInTheSameRow) {
  CounterRandom random(13, 0, RandomPurpose::kTest);
  int whole = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    const Configuration c = random_pair(random);
    const PairVolume volume = make_pair_volume(c.a, c.b, c.bound, 7);
    if (!shows_whole_ball(volume, c.bound)) continue;
    ++whole;
    const auto views = pair_views(volume, {0.5, 0.5});
    const glm::dvec3 point = random_inside(random, c.bound);
    const MapPoint in_a = project(views[0], point), in_b = project(views[1], point);
    ASSERT_TRUE(in_a.in_window && in_b.in_window);
    EXPECT_NEAR(in_a.y, in_b.y, 1e-6 * 7);
  }
  EXPECT_GT(whole, 500);
}

// Each window is centred on the image of the centre, and on its wider side as tight as it can be.
TEST(PairVolume, WindowsAreTightAroundTheBall) {
  CounterRandom random(14, 0, RandomPurpose::kTest);
  for (int trial = 0; trial < 3; ++trial) {
    Configuration c;
    PairVolume volume;
    do {
      c = random_pair(random);
      volume = make_pair_volume(c.a, c.b, c.bound, 7);
    } while (!shows_whole_ball(volume, c.bound));
    const PairCoordinates center = pair_coordinates(volume, c.bound.center_m);
    double of_a = 0, of_b = 0, top = 0;
    for (int i = 0; i < 200000; ++i) {
      const glm::dvec3 p = c.bound.center_m + glm::normalize(random_vector(random, 1)) * c.bound.radius_m;
      const PairCoordinates at = pair_coordinates(volume, p);
      of_a = std::max(of_a, std::abs(at.xa - center.xa)), of_b = std::max(of_b, std::abs(at.xb - center.xb)),
      top = std::max(top, at.y);
    }
    EXPECT_NEAR(center.xa, (volume.xa_min + volume.xa_max) / 2, 1e-9 * (volume.xa_max - volume.xa_min));
    EXPECT_NEAR(center.xb, (volume.xb_min + volume.xb_max) / 2, 1e-9 * (volume.xb_max - volume.xb_min));
    EXPECT_NEAR(of_a * 2, volume.xa_max - volume.xa_min, 0.02 * of_a);
    EXPECT_NEAR(of_b * 2, volume.xb_max - volume.xb_min, 0.02 * of_b);
    EXPECT_NEAR(top, volume.y_top, 0.02 * volume.y_top);
  }
}

// Where a ray from A and a ray from B come nearest to each other, if that is in front of both, by the general formula
// for two lines.
std::optional<glm::dvec3> nearest_meeting(const glm::dvec3& a, const glm::dvec3& da, const glm::dvec3& b,
                                          const glm::dvec3& db, double& apart) {
  const glm::dvec3 w = a - b;
  const double aa = glm::dot(da, da), ab = glm::dot(da, db), bb = glm::dot(db, db), aw = glm::dot(da, w),
               bw = glm::dot(db, w);
  const double den = aa * bb - ab * ab;
  if (den < 1e-14 * aa * bb) return std::nullopt;  // parallel
  const double s = (ab * bw - bb * aw) / den, t = (aa * bw - ab * aw) / den;
  if (s <= 0 || t <= 0) return std::nullopt;
  const glm::dvec3 on_a = a + s * da, on_b = b + t * db;
  apart = glm::distance(on_a, on_b);
  return (on_a + on_b) / 2.0;
}

// The candidates are exactly the points in the ball where any ray of A meets any ray of B, found among all r^4 pairs of
// rays.
TEST(PairVolume, CandidatesAreWhereRaysMeetByBruteForce) {
  CounterRandom random(15, 0, RandomPurpose::kTest);
  int complete = 0, incomplete = 0, edges = 0;
  size_t fewest = SIZE_MAX;
  for (int trial = 0; trial < 400; ++trial) {
    const Configuration c = random_pair(random);
    const int r = 3 + 2 * static_cast<int>(random.next_below(3));
    const PairVolume volume = make_pair_volume(c.a, c.b, c.bound, r);
    const glm::dvec2 jitter = trial % 2 == 0 ? glm::dvec2(0.5) : glm::dvec2(random.next_unit(), random.next_unit());
    const auto views = pair_views(volume, jitter);
    std::vector<std::pair<glm::ivec3, glm::dvec3>> expected;
    bool near_edge = false;
    for (int ya = 0; ya < r; ++ya)
      for (int xa = 0; xa < r; ++xa)
        for (int yb = 0; yb < r; ++yb)
          for (int xb = 0; xb < r; ++xb) {
            double apart = 0;
            const auto at = nearest_meeting(c.a, texel_direction(views[0], xa, ya), c.b,
                                            texel_direction(views[1], xb, yb), apart);
            if (!at || apart > 1e-7 * (1 + glm::distance(*at, c.a))) continue;
            EXPECT_EQ(ya, yb) << "only rays of equal rows meet";
            near_edge |= std::abs(glm::distance(*at, c.bound.center_m) - c.bound.radius_m) < 1e-6;
            if (c.bound.contains(*at)) expected.push_back({{xb, ya, r - 1 - xa}, *at});
          }
    if (near_edge) {
      ++edges;
      continue;
    }
    std::vector<std::pair<glm::ivec3, glm::dvec3>> found;
    for_each_meeting(volume, c.bound, jitter, [&](const glm::ivec3& texels, const glm::dvec3& point) {
      found.push_back({texels, point});
    });
    const auto before = [](const auto& x, const auto& y) {
      return std::tie(x.first.x, x.first.y, x.first.z) < std::tie(y.first.x, y.first.y, y.first.z);
    };
    std::sort(expected.begin(), expected.end(), before), std::sort(found.begin(), found.end(), before);
    ASSERT_EQ(found.size(), expected.size()) << trial;
    EXPECT_EQ(count_meetings(volume, c.bound, jitter), found.size());
    for (size_t i = 0; i < found.size(); ++i) {
      ASSERT_EQ(found[i].first, expected[i].first);
      EXPECT_LT(glm::distance(found[i].second, expected[i].second), 1e-6 * (1 + glm::distance(found[i].second, c.a)));
    }
    if (trial % 2 == 0) fewest = std::min(fewest, found.size());
    ++(volume.length_m + volume.xa_min - volume.xb_max > 0 ? complete : incomplete);
  }
  EXPECT_GT(complete, 50);
  EXPECT_GT(incomplete, 50) << "some rays of A meet no ray of B";
  EXPECT_LT(edges, 20);
  EXPECT_GE(fewest, 1u) << "the middle rays of an odd number meet at the centre";
}

TEST(PairVolume, APointOfTheGridHasItsOwnTexels) {
  CounterRandom random(17, 0, RandomPurpose::kTest);
  for (int trial = 0; trial < 200; ++trial) {
    const Configuration c = random_pair(random);
    const glm::dvec2 jitter(random.next_unit(), random.next_unit());
    const PairVolume volume = make_pair_volume(c.a, c.b, c.bound, 7);
    for_each_meeting(volume, c.bound, jitter, [&](const glm::ivec3& texels, const glm::dvec3& point) {
      EXPECT_EQ(nearest_texels(volume, point, jitter), texels);
    });
  }
}

TEST(PairVolume, PointsOutsideItHaveNoTexels) {
  const PairVolume volume = make_pair_volume({-1, 0, 0}, {1, 0, 0}, ball({0, 0, 5}, 0.5), 7);
  const glm::dvec2 middle(0.5);
  EXPECT_EQ(nearest_texels(volume, {0, 0, 5}, middle), glm::ivec3(3, 3, 3));
  EXPECT_TRUE(nearest_texels(volume, {0, 0, 5.49}, middle));
  EXPECT_FALSE(nearest_texels(volume, {0, 0, 5.6}, middle)) << "behind the far plane";
  EXPECT_FALSE(nearest_texels(volume, {0, 0, -5}, middle)) << "behind the targets";
  EXPECT_FALSE(nearest_texels(volume, {0, 0.7, 5}, middle)) << "above the windows";
  EXPECT_FALSE(nearest_texels(volume, {0.7, 0, 5}, middle)) << "in neither window";
  EXPECT_FALSE(nearest_texels(volume, {0, 0, 2}, middle)) << "A's rays through here pass left of B's";
}

TEST(PairVolume, NamesEachCaseWithoutOne) {
  const glm::dvec3 a(-1, 0, 0), b(1, 0, 0);
  EXPECT_EQ(pair_gap(a, b, ball({0, 0, 50}, 0.99)), PairGap::kNone);
  EXPECT_EQ(pair_gap(a, b, ball({0, 0, 50}, 1.01)), PairGap::kNone) << "incomplete";
  EXPECT_EQ(pair_gap(a, a + glm::dvec3(0.1, 0, 0), ball({0, 0, 5}, 0.5)), PairGap::kNone) << "a close pair";
  EXPECT_EQ(pair_gap(a, b, ball({-3, 0.2, 0}, 0.5)), PairGap::kNone) << "over the shoulder";
  EXPECT_EQ(pair_gap(a, b, ball({0, 0.1, 0.1}, 0.5)), PairGap::kNone) << "between the targets";
  EXPECT_EQ(pair_gap(a, a, ball({0, 0, 5}, 0.5)), PairGap::kTooClose) << "at the same place";
  EXPECT_EQ(pair_gap(a, b, ball({5, 0, 0}, 0.5)), PairGap::kOnLine) << "on the line AB";
  // Beside the line, but the rays from the far target could not be told from it.
  EXPECT_EQ(pair_gap(a, {8e8, 0, 0}, ball({0, 0, 5}, 0.5)), PairGap::kOnLine);
  EXPECT_EQ(pair_gap(a, {8e5, 0, 0}, ball({0, 0, 5}, 0.5)), PairGap::kNone);
  EXPECT_EQ(pair_gap(a, b, ball({1.2, 0.1, 0}, 0.5)), PairGap::kTargetInBound);
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

}  // namespace
}  // namespace sightline
