#include "server/aggregate/lattice.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>
#include <tuple>

#include "tests/aggregate/random_ball.h"

namespace sightline {
namespace {

using Place = std::tuple<double, double, double>;
Place key(const glm::dvec3& p) {
  return {p.x, p.y, p.z};
}

TEST(Lattice, HoldsAtLeastTheCandidatesAskedForAndNotManyMore) {
  for (const double radius : {0.1, 0.31, 1.25, 3.7, 20.0}) {
    for (const int candidates : {125, 343, 1000, 4096}) {
      Lattice lattice;
      lattice.cover(ball({0.3, 1.7, -2.2}, radius), candidates);
      EXPECT_GE(lattice.positions_m().size(), 0.9 * candidates) << radius;
      EXPECT_LE(lattice.positions_m().size(), 1.9 * candidates) << radius;
    }
  }
}

TEST(Lattice, ListsExactlyTheLatticePointsInsideTheBall) {
  Lattice lattice;
  const Bound bound = ball({-3.3, 0.2, 5.9}, 1.1);
  lattice.cover(bound, 200);
  std::set<Place> listed;
  for (const auto& p : lattice.positions_m()) EXPECT_TRUE(listed.insert(key(p)).second) << "listed twice";
  size_t expected = 0;
  const double s = lattice.spacing_m();
  for (int x = -60; x <= 60; ++x)
    for (int y = -60; y <= 60; ++y)
      for (int z = -60; z <= 60; ++z) {
        const glm::dvec3 p(x * s, y * s, z * s);
        if (!bound.contains(p)) continue;
        ++expected;
        EXPECT_TRUE(listed.contains(key(p)));
      }
  EXPECT_EQ(listed.size(), expected);
}

TEST(Lattice, AddressesOfCoveredCellsAreDistinct) {
  Lattice lattice;
  lattice.cover(ball({9.7, -4.1, 0.4}, 2.3), 1000);
  const std::set<uint32_t> distinct(lattice.addresses().begin(), lattice.addresses().end());
  EXPECT_EQ(distinct.size(), lattice.addresses().size());
}

// The reference: a map from lattice point to the number of its owner. A point must keep its address while it stays in
// the bound.
TEST(Lattice, ACellKeepsItsAddressWhileItStaysInTheMovingBound) {
  Lattice lattice;
  std::map<Place, uint64_t> inside;
  std::set<uint64_t> given;
  for (int step = 0; step < 200; ++step) {
    lattice.cover(ball({0.05 * step, 1.0 + 0.01 * step, -0.03 * step}, 1.25), 343);
    std::map<Place, uint64_t> now;
    for (size_t i = 0; i < lattice.positions_m().size(); ++i) {
      const Place place = key(lattice.positions_m()[i]);
      const uint64_t owner = lattice.owner(lattice.addresses()[i]);
      if (const auto known = inside.find(place); known != inside.end()) {
        ASSERT_EQ(owner, known->second);
      }
      now[place] = owner;
      given.insert(owner);
    }
    ASSERT_FALSE(given.contains(0)) << "nobody's";
    inside = std::move(now);
  }
}

TEST(Lattice, ACellThatComesInAtAnothersAddressIsAnother) {
  Lattice lattice;
  lattice.cover(ball({0, 0, 0}, 1.0), 343);
  std::set<uint64_t> former;
  for (const uint32_t address : lattice.addresses()) former.insert(lattice.owner(address));
  lattice.cover(ball({100, 0, 0}, 1.0), 343);
  for (const uint32_t address : lattice.addresses()) EXPECT_FALSE(former.contains(lattice.owner(address)));
}

// `lay` gives the same points as `cover`. Once cells have addresses, `lay` keeps them up to date.
TEST(Lattice, LaidOutItHasThePointsThatItHasWhenCovered) {
  Lattice laid, covered;
  for (int step = 0; step < 100; ++step) {
    const Bound bound = ball({0.3 * step, -0.1 * step, 1e3 * step}, 0.7 + 0.01 * step);
    laid.lay(bound, 343);
    covered.cover(bound, 343);
    ASSERT_EQ(laid.positions_m(), covered.positions_m());
    EXPECT_TRUE(laid.addresses().empty());
  }
  covered.lay(ball({1, 2, 3}, 1.0), 343);
  EXPECT_EQ(covered.addresses().size(), covered.size());
}

// When a row ends on a lattice point or only touches the ball, rounding decides whether the point is inside.
TEST(Lattice, RowsEndWhereTheBallDoesToTheBit) {
  CounterRandom random(31, 0, RandomPurpose::kTest);
  for (int trial = 0; trial < 300; ++trial) {
    Lattice lattice;
    const double far = trial % 3 == 0 ? 1e6 : 3.0;
    const double radius = trial % 2 == 0 ? random.next_in(0.5, 2.0) : 0.25 * (1 + trial % 7);
    const double spacing = lattice_spacing_m(radius, 100);
    glm::dvec3 center = random_vector(random, far);
    if (trial % 4 < 2) center = glm::round(center / spacing) * spacing;
    const Bound bound = ball(center, radius);
    lattice.lay(bound, 100);
    std::vector<glm::dvec3> expected;
    const glm::ivec3 middle(glm::round(center / spacing));
    const int reach = static_cast<int>(radius / spacing) + 2;
    for (int z = -reach; z <= reach; ++z)
      for (int y = -reach; y <= reach; ++y)
        for (int x = -reach; x <= reach; ++x) {
          const glm::dvec3 place = glm::dvec3(middle + glm::ivec3(x, y, z)) * spacing;
          if (bound.contains(place)) expected.push_back(place);
        }
    ASSERT_EQ(lattice.positions_m(), expected) << trial;
  }
}

// The ball's outermost point on one side is a lattice point, to the bit, while the row's other end lies between two
// points.
TEST(Lattice, APointOnTheSurfaceBelongsToItsRow) {
  for (const double side : {-1.0, 1.0}) {
    Lattice lattice;
    const Bound bound = ball({side * 0.25, 2.0, -3.0}, 4.75);
    lattice.lay(bound, 400);
    ASSERT_EQ(lattice.spacing_m(), 1.0);
    const auto& listed = lattice.positions_m();
    EXPECT_NE(std::find(listed.begin(), listed.end(), glm::dvec3(side * 5, 2, -3)), listed.end());
    for (const glm::dvec3& place : listed) EXPECT_TRUE(bound.contains(place));
  }
}

TEST(Lattice, SpacingIsStableUnderSmallChangesOfTheRadius) {
  int changes = 0;
  double last = lattice_spacing_m(1.0, 343);
  for (double radius = 1.0; radius < 2.0; radius += 0.001) {
    const double spacing = lattice_spacing_m(radius, 343);
    changes += spacing != last;
    last = spacing;
  }
  EXPECT_LE(changes, 4);
}

// A bound that reaches towards a target changes its radius with every step of the camera.
TEST(Lattice, KeepsItsCellsWhileTheRadiusGoesToAndFroAndWhileItGrowsWithinASpacing) {
  double at_m = 1.0;  // where the spacing changes
  while (lattice_spacing_m(at_m, 343) == lattice_spacing_m(1.0, 343)) at_m += 1e-4;
  Lattice lattice;
  lattice.cover(ball({}, 1.03 * at_m), 343);
  const double spacing_m = lattice.spacing_m();
  const auto middle = lattice.address_near({});
  ASSERT_TRUE(middle);
  const uint64_t owner = lattice.owner(*middle);
  for (const double factor : {0.97, 1.03, 0.97, 1.0, 1.1, 1.2, 1.22, 0.97}) {
    lattice.cover(ball({}, factor * at_m), 343);
    EXPECT_EQ(lattice.spacing_m(), spacing_m) << factor;
    EXPECT_EQ(lattice.address_near({}), middle) << factor;
    EXPECT_EQ(lattice.owner(*middle), owner) << factor;
  }
  lattice.cover(ball({}, 0.95 * at_m), 343);
  EXPECT_EQ(lattice.spacing_m(), lattice_spacing_m(0.95 * at_m, 343))
      << "too small a ball takes the spacing that fits it";
  lattice.cover(ball({}, 1.3 * at_m), 343);
  EXPECT_EQ(lattice.spacing_m(), lattice_spacing_m(1.3 * at_m, 343));
}

TEST(Lattice, StartedAgainItKeepsNoSpacing) {
  double at_m = 1.0;
  while (lattice_spacing_m(at_m, 343) == lattice_spacing_m(1.0, 343)) at_m += 1e-4;
  Lattice lattice;
  lattice.cover(ball({}, 1.03 * at_m), 343);
  lattice.start_again();
  lattice.cover(ball({}, 0.97 * at_m), 343);
  EXPECT_EQ(lattice.spacing_m(), lattice_spacing_m(0.97 * at_m, 343));
}

TEST(Lattice, FewerCandidatesTakeAnotherSpacingAtOnce) {
  Lattice lattice;
  lattice.cover(ball({}, 2.0), 700);
  lattice.cover(ball({}, 2.0), 350);
  EXPECT_EQ(lattice.spacing_m(), lattice_spacing_m(2.0, 350));
}

}  // namespace
}  // namespace sightline
