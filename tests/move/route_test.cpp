#include "server/move/route.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "server/move/groups.h"
#include "server/scene/clearance.h"
#include "tests/support/triangle_soup.h"

namespace sightline {
namespace {

using namespace test;

struct Nodes {
  std::vector<glm::dvec3> position_m;
  std::vector<glm::ivec3> cell;
  std::vector<float> clearance_m;
  std::vector<double> hidden;

  void add(const glm::ivec3& at, const glm::dvec3& place, double clearance, double share) {
    cell.push_back(at), position_m.push_back(place);
    clearance_m.push_back(static_cast<float>(clearance)), hidden.push_back(share);
  }
  size_t size() const { return cell.size(); }
  RouteNodes view() const { return {position_m, cell, clearance_m, hidden}; }
};

// A node stands anywhere in its cell; cells hold none, one or several, a few stand far off as an island.
Nodes random_nodes(Draw& draw) {
  Nodes nodes;
  const double filled = draw.in(0.3, 1.0), widest = draw.in(0.5, 2.0);
  const auto add = [&](const glm::ivec3& cell) {
    const glm::dvec3 place = glm::dvec3(cell) + (draw.in(0, 1) < 0.5 ? glm::dvec3(0.0) : draw.vec(0.5));
    const double hidden = draw.in(0, 1) < 0.3 ? std::round(draw.in(0, 1)) : draw.in(0, 1);
    nodes.add(cell, place, draw.in(0, 1) < 0.2 ? 0.0 : draw.in(0, widest), hidden);
  };
  for (int z = -2; z <= 2; ++z)
    for (int y = -1; y <= 1; ++y)
      for (int x = -2; x <= 2; ++x)
        for (int copy = 0; copy < 3; ++copy)
          if (draw.in(0, 1) < (copy == 0 ? filled : 0.1)) add({x, y, z});
  for (int i = 0; i < 3; ++i) add({6 + i, 0, 0});
  return nodes;
}

// The rule as route.h words it, with one exception named there: the start is a node whatever its clearance.
double leg_cost(const Nodes& n, uint32_t a, uint32_t b, uint32_t start, const RouteSettings& s) {
  const glm::ivec3 apart = glm::abs(n.cell[a] - n.cell[b]);
  if (std::max({apart.x, apart.y, apart.z}) > 1) return kUnreachable;
  if (a != start && n.clearance_m[a] < s.body_radius_m) return kUnreachable;
  if (n.clearance_m[b] < s.body_radius_m) return kUnreachable;
  const glm::dvec3 d = n.position_m[a] - n.position_m[b];
  const double length = std::sqrt(d.x * d.x + d.y * d.y + d.z * d.z);
  if (static_cast<double>(n.clearance_m[a]) + static_cast<double>(n.clearance_m[b]) <= length)
    return kUnreachable;
  return length + s.exposure * length * 0.5 * (n.hidden[a] + n.hidden[b]);
}

// Bellman-Ford: every leg is tried until nothing gets cheaper.
std::vector<double> reference_costs(const Nodes& n, uint32_t start, const RouteSettings& s) {
  std::vector<double> cost(n.size(), kUnreachable);
  cost[start] = 0;
  for (bool changed = true; changed;) {
    changed = false;
    for (uint32_t a = 0; a < n.size(); ++a)
      for (uint32_t b = 0; b < n.size(); ++b) {
        if (a == b || std::isinf(cost[a])) continue;
        const double through = cost[a] + leg_cost(n, a, b, start, s);
        if (through < cost[b] - 1e-12) cost[b] = through, changed = true;
      }
  }
  return cost;
}

RouteSettings random_settings(Draw& draw) {
  return {.body_radius_m = draw.in(0, 0.6), .exposure = draw.in(0, 1) < 0.3 ? 0.0 : draw.in(0, 10)};
}

TEST(Route, CostsAreThoseOfBellmanFordOnRandomNodes) {
  Draw draw(11);
  RouteFinder finder;
  int reached = 0, unreached = 0;
  for (int trial = 0; trial < 150; ++trial) {
    const Nodes nodes = random_nodes(draw);
    const RouteSettings settings = random_settings(draw);
    const auto start = static_cast<uint32_t>(draw.in(0, static_cast<double>(nodes.size())));
    finder.find(nodes.view(), start, settings);
    const std::vector<double> expected = reference_costs(nodes, start, settings);
    ASSERT_EQ(finder.cost_m().size(), nodes.size());
    for (size_t i = 0; i < nodes.size(); ++i) {
      ASSERT_EQ(std::isinf(finder.cost_m()[i]), std::isinf(expected[i]))
          << "trial " << trial << " node " << i;
      if (std::isinf(expected[i])) {
        ++unreached;
        continue;
      }
      ++reached;
      EXPECT_NEAR(finder.cost_m()[i], expected[i], 1e-9) << "trial " << trial << " node " << i;
    }
  }
  EXPECT_GT(reached, 1000);
  EXPECT_GT(unreached, 1000);
}

// The nodes' cells are those of a lattice of spacing 1: told so, the finder passes legs over, which must change nothing.
TEST(Route, KnowingTheLatticeChangesNoBitAndNoRoute) {
  Draw draw(17);
  RouteFinder plain, knowing;
  size_t routes = 0;
  for (int trial = 0; trial < 300; ++trial) {
    const Nodes nodes = random_nodes(draw);
    const RouteSettings settings = random_settings(draw);
    const auto start = static_cast<uint32_t>(draw.in(0, static_cast<double>(nodes.size())));
    RouteNodes view = nodes.view();
    plain.find(view, start, settings);
    view.spacing_m = 1.0;
    knowing.find(view, start, settings);
    ASSERT_EQ(knowing.cost_m(), plain.cost_m()) << "trial " << trial;
    for (uint32_t goal = 0; goal < nodes.size(); ++goal) {
      if (std::isinf(plain.cost_m()[goal])) continue;
      ASSERT_EQ(knowing.to(goal), plain.to(goal)) << "trial " << trial << " goal " << goal;
      ++routes;
    }
  }
  EXPECT_GT(routes, 3000u);
}

TEST(Route, ARouteLeadsOverNeighboursAndCostsWhatIsSaid) {
  Draw draw(12);
  RouteFinder finder;
  size_t longest = 0;
  for (int trial = 0; trial < 60; ++trial) {
    const Nodes nodes = random_nodes(draw);
    const RouteSettings settings = random_settings(draw);
    const auto start = static_cast<uint32_t>(draw.in(0, static_cast<double>(nodes.size())));
    finder.find(nodes.view(), start, settings);
    EXPECT_TRUE(finder.to(start).empty());
    for (uint32_t goal = 0; goal < nodes.size(); ++goal) {
      if (goal == start || std::isinf(finder.cost_m()[goal])) continue;
      const std::vector<uint32_t>& route = finder.to(goal);
      ASSERT_FALSE(route.empty());
      EXPECT_EQ(route.back(), goal);
      double sum = 0;
      uint32_t at = start;
      for (const uint32_t next : route) sum += leg_cost(nodes, at, next, start, settings), at = next;
      EXPECT_NEAR(sum, finder.cost_m()[goal], 1e-9);
      longest = std::max(longest, route.size());
    }
  }
  EXPECT_GE(longest, 4u);
}

TEST(Route, StartsFromAPlaceWithoutRoomButEntersNone) {
  Nodes nodes;
  for (int x = 0; x < 4; ++x) nodes.add({x, 0, 0}, {x, 0, 0}, 1.0, 0.0);
  const RouteSettings settings{.body_radius_m = 0.5, .exposure = 0};
  nodes.clearance_m[0] = 0.2f;
  RouteFinder finder;
  finder.find(nodes.view(), 0, settings);
  EXPECT_DOUBLE_EQ(finder.cost_m()[3], 3.0) << "out of a tight place";
  finder.find(nodes.view(), 3, settings);
  EXPECT_DOUBLE_EQ(finder.cost_m()[1], 2.0);
  EXPECT_EQ(finder.cost_m()[0], kUnreachable) << "into it";
}

TEST(Route, AClearanceAtTheLimitFitsAndASumAtTheLengthDoesNot) {
  Nodes nodes;
  nodes.add({0, 0, 0}, {0, 0, 0}, 0.5, 0), nodes.add({1, 0, 0}, {1, 0, 0}, 0.5, 0);
  RouteFinder finder;
  finder.find(nodes.view(), 0, {.body_radius_m = 0.25});
  EXPECT_EQ(finder.cost_m()[1], kUnreachable) << "a wall may touch both balls half way";
  nodes.clearance_m = {0.75f, 0.5f};
  finder.find(nodes.view(), 0, {.body_radius_m = 0.5});
  EXPECT_EQ(finder.cost_m()[1], 1.0);
}

// Straight through three hidden nodes, or round them in sight.
TEST(Route, ExposureBuysADetourInSight) {
  Nodes nodes;
  for (int x = 0; x < 5; ++x)
    for (int z = 0; z < 2; ++z) nodes.add({x, 0, z}, {x, 0, z}, 2.0, z == 0 && x > 0 && x < 4 ? 1.0 : 0.0);
  RouteFinder finder;
  const auto passes_hidden = [&](double exposure) {
    finder.find(nodes.view(), 0, {.body_radius_m = 0.3, .exposure = exposure});
    const auto& route = finder.to(8);
    return std::any_of(route.begin(), route.end(), [&](uint32_t node) { return nodes.hidden[node] > 0; });
  };
  EXPECT_TRUE(passes_hidden(0.0));
  EXPECT_FALSE(passes_hidden(5.0));
}

TEST(Route, OneNodeIsItsOwnRoute) {
  Nodes nodes;
  nodes.add({-40'000, 7, 40'000}, {-10'000, 2, 10'000}, 0.0, 1.0);
  RouteFinder finder;
  finder.find(nodes.view(), 0, {});
  EXPECT_EQ(finder.cost_m(), std::vector<double>{0.0});
  EXPECT_TRUE(finder.to(0).empty());
}

// What an earlier, larger or smaller, set left behind changes nothing, not in the last bit.
TEST(Route, MemoryOfFormerCallsChangesNothing) {
  Draw draw(13);
  RouteFinder reused;
  for (int trial = 0; trial < 40; ++trial) {
    const Nodes nodes = random_nodes(draw);
    const RouteSettings settings = random_settings(draw);
    RouteFinder fresh;
    reused.find(nodes.view(), 0, settings);
    fresh.find(nodes.view(), 0, settings);
    ASSERT_EQ(reused.cost_m(), fresh.cost_m());
    for (uint32_t goal = 0; goal < nodes.size(); ++goal) {
      if (std::isinf(fresh.cost_m()[goal])) continue;
      ASSERT_EQ(reused.to(goal), fresh.to(goal));
    }
  }
}

bool segment_meets_triangle(const glm::dvec3& p, const glm::dvec3& q, const Triangle& t) {
  const auto volume = [](const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c, const glm::dvec3& d) {
    return glm::dot(b - a, glm::cross(c - a, d - a));
  };
  if ((volume(t[0], t[1], t[2], p) > 0) == (volume(t[0], t[1], t[2], q) > 0)) return false;
  const bool a = volume(p, q, t[0], t[1]) > 0, b = volume(p, q, t[1], t[2]) > 0,
             c = volume(p, q, t[2], t[0]) > 0;
  return a == b && b == c;
}

// Among random triangles, with clearances as they are measured: no leg of any route passes through one.
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
          nodes.add({x, y, z}, place, field.clearance_m(place, cut_m), draw.in(0, 1));
        }
    const glm::dvec3 camera = draw.vec(1);
    std::vector<glm::ivec3> cell;
    lattice_cells(std::span(&camera, 1), spacing, cell);
    const auto start = static_cast<uint32_t>(nodes.size());
    nodes.add(cell[0], camera, field.clearance_m(camera, cut_m), 0.0);
    RouteFinder finder;
    finder.find(nodes.view(), start, {.body_radius_m = 0.02, .exposure = 3});
    std::set<std::pair<uint32_t, uint32_t>> tried;
    for (uint32_t goal = 0; goal < nodes.size(); ++goal) {
      if (std::isinf(finder.cost_m()[goal])) continue;
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
