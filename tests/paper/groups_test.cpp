#include "server/paper/groups.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <set>
#include <tuple>

#include "server/base/random.h"
#include "server/paper/robust_costs.h"

namespace sightline {
namespace {

struct Grid {
  std::vector<glm::ivec3> cells;
  std::vector<glm::dvec3> places;
  std::vector<uint8_t> members;
  glm::dvec3 desired{0.0};
  Neighbours neighbours = Neighbours::kFaces;
  GroupScratch scratch;
  Groups groups;

  // Takes the cell by value, because it may be an element of `cells`.
  void add(glm::ivec3 cell, bool member) {
    cells.push_back(cell);
    places.push_back(glm::dvec3(cell) * 0.25);
    members.push_back(member);
  }
  void fill(int low, int high, auto is_member) {
    for (int z = low; z <= high; ++z)
      for (int y = low; y <= high; ++y)
        for (int x = low; x <= high; ++x) add({x, y, z}, is_member(glm::ivec3(x, y, z)));
  }
  const Groups& find() {
    find_groups(cells, neighbours, places, members, desired, scratch, groups);
    return groups;
  }
};

// A random part of a box, with a random part of it members, listed in random order, some way from the origin.
Grid random_grid(uint64_t seed) {
  CounterRandom random(seed, 0, RandomPurpose::kTest);
  const double kept = random.next_in(0.5, 1.0), member = random.next_in(0.1, 0.95);
  const int side = 2 + static_cast<int>(random.next_below(9));
  const glm::ivec3 corner(static_cast<int>(random.next_below(2000)) - 1000, -3, static_cast<int>(random.next_below(9)));
  std::vector<std::pair<glm::ivec3, bool>> all;
  for (int z = 0; z < side; ++z)
    for (int y = 0; y < side; ++y)
      for (int x = 0; x < side; ++x)
        if (random.next_unit() < kept) all.push_back({corner + glm::ivec3(x, y, z), random.next_unit() < member});
  for (size_t i = all.size(); i > 1; --i) std::swap(all[i - 1], all[random.next_below(static_cast<uint32_t>(i))]);
  Grid grid;
  for (const auto& [cell, is_member] : all) grid.add(cell, is_member);
  grid.desired = glm::dvec3(corner) * 0.25 +
                 glm::dvec3(random.next_unit(), random.next_unit(), random.next_unit()) * 2.0;
  return grid;
}

// The reference for groups: union-find over every pair of members that touch.
struct UnionFind {
  std::vector<int> parent;
  explicit UnionFind(const Grid& grid) : parent(grid.cells.size()) {
    std::iota(parent.begin(), parent.end(), 0);
    for (size_t a = 0; a < parent.size(); ++a)
      for (size_t b = 0; b < a; ++b) {
        const glm::ivec3 d = glm::abs(grid.cells[a] - grid.cells[b]);
        const bool beside = grid.neighbours == Neighbours::kFaces ? d.x + d.y + d.z == 1
                                                                  : std::max({d.x, d.y, d.z}) == 1;
        if (grid.members[a] && grid.members[b] && beside) parent[root(a)] = root(b);
      }
  }
  int root(size_t i) const {
    int r = static_cast<int>(i);
    while (parent[r] != r) r = parent[r];
    return r;
  }
};

TEST(Groups, AreThoseOfUnionFindOnRandomSets) {
  for (uint64_t seed = 0; seed < 150; ++seed) {
    Grid grid = random_grid(seed);
    grid.neighbours = seed % 2 == 0 ? Neighbours::kFaces : Neighbours::kTouching;
    const Groups& found = grid.find();
    const UnionFind reference(grid);
    std::map<int, int> group_of_root;
    std::map<int, uint32_t> size_of_root;
    for (size_t i = 0; i < grid.cells.size(); ++i) {
      ASSERT_EQ(found.group_of[i] != kNoGroup, grid.members[i] != 0) << seed;
      if (!grid.members[i]) continue;
      ++size_of_root[reference.root(i)];
      const auto [it, fresh] = group_of_root.emplace(reference.root(i), found.group_of[i]);
      ASSERT_EQ(it->second, found.group_of[i]) << "seed " << seed << " candidate " << i;
    }
    ASSERT_EQ(group_of_root.size(), found.size_cells.size()) << "two groups are one, or one is two: seed " << seed;
    for (const auto& [root, group] : group_of_root) ASSERT_EQ(size_of_root[root], found.size_cells[group]);
  }
}

TEST(Groups, TheLargestHasMostCells) {
  for (uint64_t seed = 2000; seed < 2150; ++seed) {
    Grid grid = random_grid(seed);
    const Groups& g = grid.find();
    if (g.size_cells.empty()) {
      ASSERT_EQ(g.largest, kNoGroup);
      continue;
    }
    ASSERT_EQ(g.size_cells[g.largest], *std::max_element(g.size_cells.begin(), g.size_cells.end()));
  }
}

TEST(Groups, EqualGroupsAreDecidedByTheOneNearestToTheDesiredPlace) {
  Grid grid;
  for (int x = 0; x < 7; ++x) grid.add({x, 0, 0}, x != 3);
  grid.desired = {10, 0, 0};
  grid.find();
  EXPECT_EQ(grid.groups.largest, grid.groups.group_of[6]);
  grid.desired = {-10, 0, 0};
  grid.find();
  EXPECT_EQ(grid.groups.largest, grid.groups.group_of[0]);
}

TEST(Groups, ALargerGroupWinsOverANearerOne) {
  Grid grid;
  for (int x = 0; x < 8; ++x) grid.add({x, 0, 0}, x != 2);
  grid.desired = {-10, 0, 0};
  grid.find();
  EXPECT_EQ(grid.groups.largest, grid.groups.group_of[3]);
}

TEST(Groups, TouchingAtAnEdgeOrACornerConnectsOnlyWhereAskedFor) {
  Grid grid;
  for (const glm::ivec3 c : {glm::ivec3(0, 0, 0), glm::ivec3(1, 1, 0), glm::ivec3(2, 2, 1)}) grid.add(c, true);
  EXPECT_EQ(grid.find().size_cells.size(), 3u);
  grid.neighbours = Neighbours::kTouching;
  EXPECT_EQ(grid.find().size_cells.size(), 1u);
}

TEST(Groups, APlaceOffTheGridSharesItsCellsGroupOnlyWhenBothAreMembers) {
  Grid grid;
  grid.fill(-2, 2, [](const glm::ivec3& c) { return c.x > -2; });
  const size_t on_grid = grid.cells.size();
  grid.add({0, 0, 0}, true), grid.add({0, 0, 0}, false), grid.add({-2, 0, 0}, true);
  const Groups& g = grid.find();
  EXPECT_EQ(g.group_of[on_grid], g.largest);
  EXPECT_EQ(g.group_of[on_grid + 1], kNoGroup);
  EXPECT_EQ(g.group_of[on_grid + 2], kNoGroup) << "its cell is hidden, so it is not known to hang together with any";
  EXPECT_EQ(g.size_cells[g.largest], 100u) << "cells are counted, not candidates";
}

TEST(Groups, NothingAndNoMembersAreNoGroup) {
  Grid grid;
  EXPECT_EQ(grid.find().largest, kNoGroup);
  grid.fill(0, 2, [](const glm::ivec3&) { return false; });
  EXPECT_EQ(grid.find().largest, kNoGroup);
  EXPECT_TRUE(grid.groups.size_cells.empty());
}

TEST(Groups, ScatteredCandidatesAreFoundWithoutAGridAroundThem) {
  Grid grid;
  grid.fill(-1, 1, [](const glm::ivec3&) { return true; });
  grid.add({2'000'000'000, -2'000'000'000, 7}, true);
  const Groups& g = grid.find();
  EXPECT_EQ(g.size_cells.size(), 2u);
  EXPECT_EQ(g.group_of[0], g.largest);
}

TEST(Groups, TheOrderOfCandidatesChangesNoGroup) {
  Grid grid = random_grid(7);
  Grid reversed = grid;
  std::reverse(reversed.cells.begin(), reversed.cells.end());
  std::reverse(reversed.places.begin(), reversed.places.end());
  std::reverse(reversed.members.begin(), reversed.members.end());
  const Groups &a = grid.find(), &b = reversed.find();
  ASSERT_NE(a.largest, kNoGroup);
  for (size_t i = 0; i < grid.cells.size(); ++i)
    EXPECT_EQ(a.group_of[i] == a.largest, b.group_of[grid.cells.size() - 1 - i] == b.largest);
}

TEST(Groups, MemoryIsReusedFromCallToCall) {
  Grid grid = random_grid(11);
  grid.find();
  const auto* group = grid.groups.group_of.data();
  const auto* slot = &grid.scratch.table.slot_of(grid.cells[0]);
  const auto* queue = grid.scratch.queue.data();
  for (int i = 0; i < 5; ++i) grid.find();
  EXPECT_EQ(group, grid.groups.group_of.data());
  EXPECT_EQ(slot, &grid.scratch.table.slot_of(grid.cells[0]));
  EXPECT_EQ(queue, grid.scratch.queue.data());
}

TEST(Groups, LatticeCellsAreTheRoundedMultiplesOfTheSpacing) {
  const double spacing = std::exp2(-2.25);
  std::vector<glm::ivec3> cells;
  std::vector<glm::dvec3> places;
  for (int i = -900; i <= 900; ++i) places.push_back(glm::dvec3(i, -i, 2 * i) * spacing);
  lattice_cells(places, spacing, cells);
  for (int i = -900; i <= 900; ++i) ASSERT_EQ(cells[i + 900], glm::ivec3(i, -i, 2 * i));
}

struct Cells {
  std::vector<glm::ivec3> cells;
  std::vector<uint8_t> members;
  EdgeDistanceScratch scratch;

  void add(const glm::ivec3& cell, bool member) {
    cells.push_back(cell);
    members.push_back(member);
  }
  std::vector<uint32_t> measure() {
    std::vector<uint32_t> distance;
    measure_edge_distances(cells, members, scratch, distance);
    return distance;
  }
};

// Cells scattered in a rough ball, some of them twice, at some distance from the origin.
Cells random_cells(uint64_t seed) {
  CounterRandom random(seed, 0, RandomPurpose::kTest);
  Cells c;
  const int count = 1 + static_cast<int>(random.next_below(200));
  const double member = random.next_in(0.5, 1.0);
  const auto coordinate = [&] { return static_cast<int>(random.next_below(11)) - 700; };
  for (int i = 0; i < count; ++i) {
    const int x = coordinate(), y = coordinate(), z = coordinate();
    c.add({x, y, z}, random.next_unit() < member);
  }
  return c;
}

uint32_t nearest_hidden_squared(const Cells& c, size_t i) {
  uint32_t least = kAllOpen;
  for (size_t k = 0; k < c.cells.size(); ++k) {
    if (c.members[k]) continue;
    const glm::ivec3 way = c.cells[k] - c.cells[i];
    least = std::min(least, static_cast<uint32_t>(way.x * way.x + way.y * way.y + way.z * way.z));
  }
  return least;
}

TEST(Center, IsTheMeanOfTheLargestGroupAndItsMembersComeFirst) {
  // A row of seven cells, of which the third is hidden, around a desired position at its start.
  Grid grid;
  for (int x = 0; x < 7; ++x) grid.add({x, 0, 0}, x != 2);
  grid.find();
  EXPECT_EQ(center_of_largest_m(grid.places, grid.groups), glm::dvec3(4.5 * 0.25, 0, 0));
  std::vector<double> cost;
  center_costs(grid.places, grid.desired, grid.groups, cost);
  const auto order = [&](size_t i) { return cost[i]; };
  for (size_t inside = 3; inside < 7; ++inside) {
    EXPECT_NEAR(order(inside), std::abs(static_cast<double>(inside) - 4.5) * 0.25, 1e-12);
    for (size_t outside = 0; outside < 3; ++outside) EXPECT_LT(order(inside), order(outside));
  }
  std::fill(grid.members.begin(), grid.members.end(), uint8_t{0});
  grid.find();
  center_costs(grid.places, grid.desired, grid.groups, cost);
  EXPECT_EQ(std::min_element(cost.begin(), cost.end()) - cost.begin(), 0) << "no group: as Basic";
}

TEST(EdgeDistance, IsTheDistanceToTheNearestHiddenCandidate) {
  for (uint64_t seed = 0; seed < 200; ++seed) {
    Cells c = random_cells(seed);
    const std::vector<uint32_t> distance = c.measure();
    ASSERT_EQ(distance.size(), c.cells.size());
    for (size_t i = 0; i < distance.size(); ++i)
      ASSERT_EQ(distance[i], nearest_hidden_squared(c, i)) << "seed " << seed << ", candidate " << i;
  }
}

TEST(EdgeDistance, CountsNothingBeyondTheCandidates) {
  Cells c;
  for (int x = 0; x < 5; ++x) c.add({x, 0, 0}, true);
  for (const uint32_t distance : c.measure()) EXPECT_EQ(distance, kAllOpen);
  c.members[0] = 0;
  EXPECT_EQ(c.measure().back(), 16u) << "at the end of the row, but farthest from the hidden one";
}

// One end of a row of candidates is hidden. The goal is the other end, although the row stops there. When nothing is
// hidden, the goal is the candidate nearest to the desired position.
TEST(Robust, LeavesHiddenCandidatesAndElseGoesToTheDesiredPosition) {
  Cells c;
  std::vector<glm::dvec3> places;
  for (int x = 0; x < 7; ++x) {
    c.add({x, 0, 0}, x > 1);
    places.push_back({x, 0, 0});
  }
  GroupScratch scratch;
  Groups groups;
  std::vector<double> cost;
  const auto cheapest = [&](const glm::dvec3& desired) {
    find_groups(c.cells, Neighbours::kFaces, places, c.members, desired, scratch, groups);
    robust_costs(places, desired, groups, c.measure(), cost);
    return std::min_element(cost.begin(), cost.end()) - cost.begin();
  };
  EXPECT_EQ(cheapest({2, 0, 0}), 6);
  std::fill(c.members.begin(), c.members.end(), uint8_t{1});
  EXPECT_EQ(cheapest({2, 0, 0}), 2);
  EXPECT_EQ(cheapest({9, 0, 0}), 6);
  std::fill(c.members.begin(), c.members.end(), uint8_t{0});
  EXPECT_EQ(cheapest({3, 0, 0}), 3) << "no group: as Basic";
}

}  // namespace
}  // namespace sightline
