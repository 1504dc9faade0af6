#include "server/move/route.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "server/scene/clearance.h"
#include "tests/move/random_nodes.h"
#include "tests/support/triangle_soup.h"

namespace sightline {
namespace {

using namespace test;

// All routes, as a search finds them that continues to the end.
class Ways {
 public:
  void find(const RouteNodes& nodes, uint32_t start, double body_radius_m) {
    finder_.begin(nodes, start, body_radius_m);
    length_m_.assign(nodes.cell.size(), kUnreachable);
    double last_m = 0;
    while (const auto node = finder_.settle_next()) {
      length_m_[*node] = finder_.length_m(*node);
      EXPECT_GE(length_m_[*node], last_m) << "the nearest first";
      last_m = length_m_[*node];
    }
  }
  const std::vector<double>& length_m() const { return length_m_; }
  const std::vector<uint32_t>& to(uint32_t goal) { return finder_.to(goal); }

 private:
  RouteFinder finder_;
  std::vector<double> length_m_;
};

// The rule of route.h with its one exception: the start is a node even where the body has no room.
double leg_m(const Nodes& n, uint32_t a, uint32_t b, uint32_t start, double body_m) {
  const glm::ivec3 apart = glm::abs(n.cell[a] - n.cell[b]);
  if (std::max({apart.x, apart.y, apart.z}) > 1) return kUnreachable;
  if (a != start && n.clearance_m[a] < body_m) return kUnreachable;
  if (n.clearance_m[b] < body_m) return kUnreachable;
  const glm::dvec3 d = n.position_m[a] - n.position_m[b];
  const double length = std::sqrt(d.x * d.x + d.y * d.y + d.z * d.z);
  if (static_cast<double>(n.clearance_m[a]) + static_cast<double>(n.clearance_m[b]) <= length) return kUnreachable;
  return length;
}

// Bellman-Ford: every leg is tried until nothing gets shorter.
std::vector<double> reference_lengths_m(const Nodes& n, uint32_t start, double body_m) {
  std::vector<double> length_m(n.size(), kUnreachable);
  length_m[start] = 0;
  for (bool changed = true; changed;) {
    changed = false;
    for (uint32_t a = 0; a < n.size(); ++a)
      for (uint32_t b = 0; b < n.size(); ++b) {
        if (a == b || std::isinf(length_m[a])) continue;
        const double through_m = length_m[a] + leg_m(n, a, b, start, body_m);
        if (through_m < length_m[b] - 1e-12) length_m[b] = through_m, changed = true;
      }
  }
  return length_m;
}

TEST(Route, LengthsAreThoseOfBellmanFordOnRandomNodes) {
  Draw draw(11);
  Ways finder;
  int reached = 0, unreached = 0;
  for (int trial = 0; trial < 150; ++trial) {
    const Nodes nodes = random_nodes(draw);
    const double body_m = random_body_m(draw);
    const auto start = static_cast<uint32_t>(draw.in(0, static_cast<double>(nodes.size())));
    finder.find(nodes.view(), start, body_m);
    const std::vector<double> expected = reference_lengths_m(nodes, start, body_m);
    ASSERT_EQ(finder.length_m().size(), nodes.size());
    for (size_t i = 0; i < nodes.size(); ++i) {
      ASSERT_EQ(std::isinf(finder.length_m()[i]), std::isinf(expected[i])) << "trial " << trial << " node " << i;
      if (std::isinf(expected[i])) {
        ++unreached;
        continue;
      }
      ++reached;
      EXPECT_NEAR(finder.length_m()[i], expected[i], 1e-9) << "trial " << trial << " node " << i;
    }
  }
  EXPECT_GT(reached, 1000);
  EXPECT_GT(unreached, 1000);
}

// The nodes are on a lattice of spacing 1. When the finder knows the spacing it skips legs, which must change nothing.
TEST(Route, KnowingTheLatticeChangesNoBitAndNoRoute) {
  Draw draw(17);
  Ways plain, knowing;
  size_t routes = 0;
  for (int trial = 0; trial < 300; ++trial) {
    const Nodes nodes = random_nodes(draw);
    const double body_m = random_body_m(draw);
    const auto start = static_cast<uint32_t>(draw.in(0, static_cast<double>(nodes.size())));
    RouteNodes view = nodes.view();
    plain.find(view, start, body_m);
    view.spacing_m = 1.0;
    knowing.find(view, start, body_m);
    ASSERT_EQ(knowing.length_m(), plain.length_m()) << "trial " << trial;
    for (uint32_t goal = 0; goal < nodes.size(); ++goal) {
      if (std::isinf(plain.length_m()[goal])) continue;
      ASSERT_EQ(knowing.to(goal), plain.to(goal)) << "trial " << trial << " goal " << goal;
      ++routes;
    }
  }
  EXPECT_GT(routes, 3000u);
}

// For the nodes that it has settled, a search that ends early gives the same result as one that continues to the end.
TEST(Route, WhatIsSettledIsFinal) {
  Draw draw(18);
  Ways all;
  RouteFinder some;
  size_t open = 0;
  for (int trial = 0; trial < 60; ++trial) {
    const Nodes nodes = random_nodes(draw);
    const RouteNodes view = nodes.view();
    const double body_m = random_body_m(draw);
    all.find(view, 0, body_m);
    some.begin(view, 0, body_m);
    for (int settled = 0; settled < 8; ++settled) {
      const auto node = some.settle_next();
      if (!node) break;
      ASSERT_TRUE(some.is_settled(*node) && !some.is_open(*node));
      ASSERT_EQ(some.length_m(*node), all.length_m()[*node]);
      ASSERT_EQ(some.to(*node), all.to(*node));
    }
    for (uint32_t i = 0; i < nodes.size(); ++i) {
      open += some.is_open(i);
      const bool known = some.is_settled(i) || some.is_open(i);
      ASSERT_TRUE(known || std::isinf(all.length_m()[i])) << "what is given up is out of reach";
    }
  }
  EXPECT_GT(open, 1000u);
}

TEST(Route, ARouteLeadsOverNeighboursAtTheReportedLength) {
  Draw draw(12);
  Ways finder;
  size_t longest = 0;
  for (int trial = 0; trial < 60; ++trial) {
    const Nodes nodes = random_nodes(draw);
    const double body_m = random_body_m(draw);
    const auto start = static_cast<uint32_t>(draw.in(0, static_cast<double>(nodes.size())));
    finder.find(nodes.view(), start, body_m);
    EXPECT_TRUE(finder.to(start).empty());
    for (uint32_t goal = 0; goal < nodes.size(); ++goal) {
      if (goal == start || std::isinf(finder.length_m()[goal])) continue;
      const std::vector<uint32_t>& route = finder.to(goal);
      ASSERT_FALSE(route.empty());
      EXPECT_EQ(route.back(), goal);
      double sum = 0;
      uint32_t at = start;
      for (const uint32_t next : route) sum += leg_m(nodes, at, next, start, body_m), at = next;
      EXPECT_NEAR(sum, finder.length_m()[goal], 1e-9);
      longest = std::max(longest, route.size());
    }
  }
  EXPECT_GE(longest, 4u);
}

TEST(Route, StartsFromAPlaceWithoutRoomButEntersNone) {
  Nodes nodes;
  for (int x = 0; x < 4; ++x) nodes.add({x, 0, 0}, {x, 0, 0}, 1.0);
  const double body_m = 0.5;
  nodes.clearance_m[0] = 0.2f;
  Ways finder;
  finder.find(nodes.view(), 0, body_m);
  EXPECT_DOUBLE_EQ(finder.length_m()[3], 3.0) << "out of a tight place";
  finder.find(nodes.view(), 3, body_m);
  EXPECT_DOUBLE_EQ(finder.length_m()[1], 2.0);
  EXPECT_EQ(finder.length_m()[0], kUnreachable) << "into it";
}

TEST(Route, AClearanceAtTheLimitFitsAndASumAtTheLengthDoesNot) {
  Nodes nodes;
  nodes.add({0, 0, 0}, {0, 0, 0}, 0.5), nodes.add({1, 0, 0}, {1, 0, 0}, 0.5);
  Ways finder;
  finder.find(nodes.view(), 0, 0.25);
  EXPECT_EQ(finder.length_m()[1], kUnreachable) << "a wall may touch both balls half way";
  nodes.clearance_m = {0.75f, 0.5f};
  finder.find(nodes.view(), 0, 0.5);
  EXPECT_EQ(finder.length_m()[1], 1.0);
}

// The balls of both nodes overlap, but between them is too little room for the body. Only the callback knows whether it
// fits.
TEST(Route, TheFirstLegIsAskedForUnlessTheClearancesHoldTheBodyAllTheWay) {
  Nodes nodes;
  nodes.add({0, 0, 0}, {0, 0, 0}, 2.5), nodes.add({1, 0, 0}, {3.5, 0, 0}, 2.5);
  for (const bool free : {false, true}) {
    RouteNodes view = nodes.view();
    int asked = 0;
    view.first_leg_is_free = [&](uint32_t) { return ++asked, free; };
    Ways ways;
    ways.find(view, 0, 1.5);
    EXPECT_GT(asked, 0);
    EXPECT_EQ(ways.length_m()[1], free ? 3.5 : kUnreachable);
  }
  RouteNodes view = nodes.view();
  view.first_leg_is_free = [](uint32_t) { return ADD_FAILURE() << "the clearances say it", false; };
  Ways ways;
  ways.find(view, 0, 0.5);
  EXPECT_EQ(ways.length_m()[1], 3.5);
}

TEST(Route, OneNodeIsItsOwnRoute) {
  Nodes nodes;
  nodes.add({-40'000, 7, 40'000}, {-10'000, 2, 10'000}, 0.0);
  Ways finder;
  finder.find(nodes.view(), 0, 0.3);
  EXPECT_EQ(finder.length_m(), std::vector<double>{0.0});
  EXPECT_TRUE(finder.to(0).empty());
}

// Memory that an earlier set has left, larger or smaller, changes no bit of the result.
TEST(Route, MemoryOfFormerCallsChangesNothing) {
  Draw draw(13);
  Ways reused;
  for (int trial = 0; trial < 40; ++trial) {
    const Nodes nodes = random_nodes(draw);
    const double body_m = random_body_m(draw);
    Ways fresh;
    reused.find(nodes.view(), 0, body_m);
    fresh.find(nodes.view(), 0, body_m);
    ASSERT_EQ(reused.length_m(), fresh.length_m());
    for (uint32_t goal = 0; goal < nodes.size(); ++goal) {
      if (std::isinf(fresh.length_m()[goal])) continue;
      ASSERT_EQ(reused.to(goal), fresh.to(goal));
    }
  }
}

bool segment_meets_triangle(const glm::dvec3& p, const glm::dvec3& q, const Triangle& t) {
  const auto volume = [](const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c, const glm::dvec3& d) {
    return glm::dot(b - a, glm::cross(c - a, d - a));
  };
  if ((volume(t[0], t[1], t[2], p) > 0) == (volume(t[0], t[1], t[2], q) > 0)) return false;
  const bool a = volume(p, q, t[0], t[1]) > 0, b = volume(p, q, t[1], t[2]) > 0, c = volume(p, q, t[2], t[0]) > 0;
  return a == b && b == c;
}

// Among random triangles, with measured clearances: no leg of any route passes through a triangle.
TEST(Route, NoLegPassesThroughATriangle) {
  Draw draw(14);
  int legs = 0, blocked = 0;
  for (int trial = 0; trial < 8; ++trial) {
    SceneMirror mirror;
    add(mirror, placed(1, random_soup(draw, 200)));
    ClearanceField field;
    field.gather(mirror, {0, 0, 0}, 100, {});
    const std::vector<Triangle> triangles = world_triangles(mirror);
    Nodes nodes;
    const double spacing = draw.in(0.35, 0.6), cut_m = 2 * spacing;
    for (int z = -4; z <= 4; ++z)
      for (int y = -4; y <= 4; ++y)
        for (int x = -4; x <= 4; ++x) {
          const glm::dvec3 place = glm::dvec3(x, y, z) * spacing;
          nodes.add({x, y, z}, place, field.clearance_m(place, cut_m));
        }
    const glm::dvec3 camera = draw.vec(1);
    std::vector<glm::ivec3> cell;
    lattice_cells(std::span(&camera, 1), spacing, cell);
    const auto start = static_cast<uint32_t>(nodes.size());
    nodes.add(cell[0], camera, field.clearance_m(camera, cut_m));
    Ways finder;
    finder.find(nodes.view(), start, 0.02);
    std::set<std::pair<uint32_t, uint32_t>> tried;
    for (uint32_t goal = 0; goal < nodes.size(); ++goal) {
      if (std::isinf(finder.length_m()[goal])) continue;
      uint32_t at = start;
      for (const uint32_t next : finder.to(goal)) {
        if (tried.insert({at, next}).second) {
          for (const Triangle& t : triangles)
            EXPECT_FALSE(segment_meets_triangle(nodes.position_m[at], nodes.position_m[next], t));
        }
        at = next;
      }
    }
    legs += static_cast<int>(tried.size());
    for (uint32_t i = 0; i < start; ++i)
      for (const Triangle& t : triangles) blocked += segment_meets_triangle(camera, nodes.position_m[i], t);
  }
  EXPECT_GT(legs, 1000);
  EXPECT_GT(blocked, 1000) << "straight lines would have passed through";
}

}  // namespace
}  // namespace sightline
