#include "server/move/shelter.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "server/base/random.h"
#include "server/move/cost.h"

namespace sightline {
namespace {

struct Cells {
  std::vector<glm::ivec3> cells;
  std::vector<uint8_t> members;
  ShelterScratch scratch;

  void add(const glm::ivec3& cell, bool member) {
    cells.push_back(cell);
    members.push_back(member);
  }
  std::vector<uint32_t> measure() {
    std::vector<uint32_t> shelter;
    measure_shelter(cells, members, scratch, shelter);
    return shelter;
  }
};

// A ball-like scatter of cells, some twice, some way from the origin.
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

TEST(Shelter, IsTheDistanceToTheNearestHiddenCandidate) {
  for (uint64_t seed = 0; seed < 200; ++seed) {
    Cells c = random_cells(seed);
    const std::vector<uint32_t> shelter = c.measure();
    ASSERT_EQ(shelter.size(), c.cells.size());
    for (size_t i = 0; i < shelter.size(); ++i)
      ASSERT_EQ(shelter[i], nearest_hidden_squared(c, i)) << "seed " << seed << ", candidate " << i;
  }
}

TEST(Shelter, CountsNothingBeyondTheCandidates) {
  Cells c;
  for (int x = 0; x < 5; ++x) c.add({x, 0, 0}, true);
  for (const uint32_t shelter : c.measure()) EXPECT_EQ(shelter, kAllOpen);
  c.members[0] = 0;
  EXPECT_EQ(c.measure().back(), 16u) << "at the end of the row, but farthest from the hidden one";
}

// A row of places of which one end is hidden: the goal is the other end, although its neighbours end there. With nothing
// hidden it is the place nearest to the desired one.
TEST(Robust, GoesAwayFromWhatIsHiddenAndElseToTheDesiredPlace) {
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
    find_groups(c.cells, places, c.members, desired, scratch, groups);
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
