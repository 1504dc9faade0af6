#include "server/aggregate/lattice.h"

#include <gtest/gtest.h>

#include <map>
#include <set>
#include <tuple>

namespace sightline {
namespace {

Bound ball(const glm::dvec3& center, double radius) {
  Bound bound;
  bound.center_m = center;
  bound.radius_m = radius;
  return bound;
}

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

// The plain reference: a map from place to what was last stored, forgotten when the place leaves the bound for so long that
// its address goes to another cell; while it stays inside it must never be forgotten.
TEST(Lattice, ACellKeepsItsStateWhileItStaysInTheMovingBound) {
  Lattice lattice;
  std::map<Place, std::pair<uint32_t, uint32_t>> inside;  // last visible, steps known
  for (int step = 0; step < 200; ++step) {
    lattice.cover(ball({0.05 * step, 1.0 + 0.01 * step, -0.03 * step}, 1.25), 343);
    std::map<Place, std::pair<uint32_t, uint32_t>> now;
    std::vector<uint32_t> visible;
    for (size_t i = 0; i < lattice.positions_m().size(); ++i) {
      const Place place = key(lattice.positions_m()[i]);
      const uint32_t address = lattice.addresses()[i];
      if (const auto known = inside.find(place); known != inside.end()) {
        ASSERT_EQ(lattice.last_visible(address), known->second.first);
        ASSERT_GE(lattice.steps_known(address), known->second.second);
      }
      visible.push_back(static_cast<uint32_t>(i * 7 + step));
      now[place] = {visible.back(), lattice.steps_known(address) + 1};
    }
    lattice.remember(visible);
    inside = std::move(now);
  }
}

TEST(Lattice, ACellThatComesInAtAnothersAddressStartsUnknown) {
  Lattice lattice;
  lattice.cover(ball({0, 0, 0}, 1.0), 343);
  lattice.remember(std::vector<uint32_t>(lattice.positions_m().size(), 5));
  lattice.cover(ball({100, 0, 0}, 1.0), 343);
  for (const uint32_t address : lattice.addresses()) {
    EXPECT_EQ(lattice.last_visible(address), 0u);
    EXPECT_EQ(lattice.steps_known(address), 0u);
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

}  // namespace
}  // namespace sightline
