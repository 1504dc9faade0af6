#include "server/aggregate/hidden_ahead.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

namespace sightline {
namespace {

Lattice lattice_at(const glm::dvec3& center_m, double radius_m = 1.0) {
  Lattice lattice;
  lattice.cover({.center_m = center_m, .radius_m = radius_m}, 100);
  return lattice;
}

std::vector<float> all(const Lattice& lattice, float share) {
  return std::vector<float>(lattice.size(), share);
}

constexpr double kRounding = 2.0 / kWholeShare;

double share_at(const HiddenAhead& ahead, size_t slice, const Lattice& lattice) {
  return static_cast<double>(ahead.shares(slice)[lattice.addresses()[0]]) / kWholeShare;
}

TEST(HiddenAhead, SlicesStayAtTheirTimeWhileThePresentGoesOn) {
  HiddenAhead ahead;
  const Lattice lattice = lattice_at({0, 0, 0});
  ahead.advance(lattice, 0.0);
  double time_s = 0;
  for (int k = 0; k < 500; ++k) {
    const double dt_s = k % 3 == 0 ? 1.0 / 30 : k % 7 == 0 ? 0.25 : 1.0 / 60;
    ahead.advance(lattice, dt_s);
    time_s += dt_s;
    const double slices = (time_s + ahead.ahead_s(0)) / kSliceS;
    ASSERT_NEAR(slices, std::round(slices), 1e-6) << "fixed on the clock";
    ASSERT_GT(ahead.ahead_s(0), 0);
    ASSERT_LE(ahead.ahead_s(0), kSliceS + 1e-6);
  }
}

TEST(HiddenAhead, AShareIsKnownAtItsTimeFromItsFirstEstimateOn) {
  HiddenAhead ahead;
  const Lattice lattice = lattice_at({0, 0, 0});
  ahead.advance(lattice, 0.0);
  for (const SharePart share : ahead.shares(5)) EXPECT_EQ(share, kUnknownShare);
  ahead.renew(5, lattice, all(lattice, 0.75f), 0.25);
  EXPECT_NEAR(share_at(ahead, 5, lattice), 0.75, kRounding) << "the first estimate counts whole";
  ahead.renew(5, lattice, all(lattice, 0.25f), 0.25);
  EXPECT_NEAR(share_at(ahead, 5, lattice), 0.625, kRounding);
  ahead.advance(lattice, 3 * kSliceS);
  EXPECT_NEAR(share_at(ahead, 2, lattice), 0.625, kRounding) << "it has come nearer";
  ahead.advance(lattice, 3 * kSliceS);
  for (size_t slice = 0; slice < kSlices; ++slice)
    EXPECT_EQ(ahead.shares(slice)[lattice.addresses()[0]], kUnknownShare) << "it has passed";
}

TEST(HiddenAhead, TheOldestEstimatesAreDueFirstAndEachInTurn) {
  HiddenAhead ahead;
  const Lattice lattice = lattice_at({0, 0, 0});
  std::array<int, kSlices> last{};
  for (int step = 1; step <= 200; ++step) {
    const double dt_s = 1.0 / 60;
    const double before_s = ahead.ahead_s(0);
    const auto due = ahead.due(dt_s, 3);
    ASSERT_EQ(due.size(), 3u);
    ahead.advance(lattice, dt_s);
    if (ahead.ahead_s(0) > before_s) {
      std::rotate(last.begin(), last.begin() + 1, last.end());
      last.back() = 0;
    }
    for (const DueSlice& slice : due) {
      EXPECT_NEAR(slice.ahead_s, ahead.ahead_s(slice.slice), 1e-12) << "the time that it has after the step";
      for (size_t other = 0; other < kSlices; ++other) {
        const bool is_due = std::any_of(due.begin(), due.end(), [&](const DueSlice& d) { return d.slice == other; });
        EXPECT_TRUE(is_due || last[slice.slice] <= last[other]) << "step " << step;
      }
    }
    for (const DueSlice& slice : due)
      ahead.renew(slice.slice, lattice, all(lattice, 0.5f), 0.5), last[slice.slice] = step;
    EXPECT_TRUE(step <= 4 || *std::min_element(last.begin(), last.end()) >= step - 5)
        << "each is renewed every fourth step or so";
  }
}

TEST(HiddenAhead, NothingIsKnownOfCellsThatAreNewToTheLattice) {
  HiddenAhead ahead;
  Lattice lattice = lattice_at({0, 0, 0});
  ahead.advance(lattice, 0.0);
  ahead.renew(3, lattice, all(lattice, 0.5f), 1.0);
  const std::vector<glm::dvec3> before = lattice.positions_m();
  lattice.cover({.center_m = {0.9, 0, 0}, .radius_m = 1.0}, 100);
  ahead.advance(lattice, 0.0);
  size_t kept = 0, added = 0;
  for (size_t i = 0; i < lattice.size(); ++i) {
    const bool was_there = std::find(before.begin(), before.end(), lattice.positions_m()[i]) != before.end();
    const SharePart share = ahead.shares(3)[lattice.addresses()[i]];
    ++(was_there ? kept : added);
    EXPECT_EQ(share, was_there ? kWholeShare / 2 : kUnknownShare);
  }
  EXPECT_GT(kept, 0u);
  EXPECT_GT(added, 0u);
}

TEST(HiddenAhead, OfTwoKnownSlicesThatAreEquallyNearTheLaterCounts) {
  HiddenAhead ahead;
  const Lattice lattice = lattice_at({0, 0, 0});
  ahead.advance(lattice, 0.0);
  const uint32_t address = lattice.addresses()[0];
  EXPECT_EQ(ahead.nearest_known(0, address), kUnknownShare);
  ahead.renew(2, lattice, all(lattice, 0.25f), 1.0);
  ahead.renew(6, lattice, all(lattice, 0.75f), 1.0);
  const SharePart early = ahead.shares(2)[address], late = ahead.shares(6)[address];
  ASSERT_NE(early, late);
  for (size_t slice = 0; slice < kSlices; ++slice)
    EXPECT_EQ(ahead.nearest_known(slice, address), slice < 4 ? early : late) << slice;
}

TEST(HiddenAhead, RestartsAsANewOne) {
  HiddenAhead ahead;
  const Lattice lattice = lattice_at({0, 0, 0});
  ahead.advance(lattice, 0.03);
  ahead.renew(0, lattice, all(lattice, 0.5f), 1.0);
  ahead.restart();
  EXPECT_EQ(ahead.ahead_s(0), HiddenAhead().ahead_s(0));
  EXPECT_EQ(ahead.due(0.02, 1)[0].slice, HiddenAhead().due(0.02, 1)[0].slice);
  for (const SharePart share : ahead.shares(0)) EXPECT_EQ(share, kUnknownShare);
}

}  // namespace
}  // namespace sightline
