// The flight plan against a search of every way, and its rules one at a time.
#include "server/move/flight_plan.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "server/base/random.h"

namespace sightline {
namespace {

constexpr double kSpacingM = 0.5;
constexpr float kWideM = 10.0f;

// A block of cells, all of them free at first.
struct Block {
  glm::ivec3 size;
  std::vector<PlaceRun> runs;
  std::vector<float> clearance_m;
  PlaceList places;
  std::vector<glm::dvec3> position_m;

  explicit Block(const glm::ivec3& cells)
      : size(cells), clearance_m(static_cast<size_t>(cells.x * cells.y * cells.z), kWideM) {
    for (int z = 0; z < size.z; ++z)
      for (int y = 0; y < size.y; ++y) runs.push_back({{0, y, z}, index({0, y, z})});
    places.set_runs(kSpacingM, runs, clearance_m.size());
    list_places(places, position_m);
  }
  uint32_t index(const glm::ivec3& cell) const {
    return static_cast<uint32_t>((cell.z * size.y + cell.y) * size.x + cell.x);
  }
  glm::ivec3 cell(uint32_t i) const {
    const int k = static_cast<int>(i);
    return {k % size.x, k / size.x % size.y, k / size.x / size.y};
  }
  glm::dvec3 at(const glm::ivec3& c) const { return glm::dvec3(c) * kSpacingM; }
};

// More than any way here has.
constexpr int kManyLegs = 20;

// The costs by slice and candidate.
using Costs = std::vector<std::vector<float>>;

const FlightPlan& planned(FlightPlanner& planner, const Block& block, const Costs& costs, const FlightStart& start,
                          const FlightSettings& settings, double body_m = 0.3, double blur = 0.0,
                          bool looks_beyond = false) {
  planner.lay(block.places, block.position_m, block.clearance_m, body_m, costs.size());
  for (size_t slice = 0; slice < costs.size(); ++slice) {
    for (uint32_t i = 0; i < costs[slice].size(); ++i) planner.costs(slice)[planner.cell_of(i)] = costs[slice][i];
    planner.blur(slice, blur);
  }
  if (looks_beyond) planner.look_beyond(settings);
  return planner.plan(start, settings);
}

// The same costs for all slices.
Costs always(const Block& block, size_t slices, float cost) {
  return Costs(slices, std::vector<float>(block.clearance_m.size(), cost));
}

// The least cost from a cell and slice on, by trying every move with a table of what was tried before. Written from the
// header alone.
class EveryWay {
 public:
  EveryWay(const Block& block, const Costs& costs, const FlightSettings& settings, double body_m,
           bool looks_beyond = false)
      : block_(block), costs_(costs), settings_(settings), body_m_(body_m), looks_beyond_(looks_beyond) {}

  // The mean cost of the time after the last slice, from a place on and with at most so many legs.
  double beyond(uint32_t i, int legs) {
    if (legs == 0) return costs_.back()[i];
    const auto [known, is_new] = beyond_.try_emplace({i, legs}, 0.0);
    if (!is_new) return known->second;
    double least = costs_.back()[i];
    for (uint32_t j = 0; j < block_.clearance_m.size(); ++j) {
      if (!can_fly(i, j)) continue;
      const double length_m = glm::distance(block_.at(block_.cell(i)), block_.at(block_.cell(j)));
      const double later = std::exp(-length_m / settings_.speed_mps / FlightPlanner::kFarS);
      least = std::min(least,
                       (1 - later) * costs_.back()[i] + later * beyond(j, legs - 1) + settings_.route * length_m);
    }
    return beyond_[{i, legs}] = least;
  }

  double from(const glm::ivec3& cell, size_t slice) {
    const uint32_t i = block_.index(cell);
    if (slice >= costs_.size())
      return settings_.afterwards * static_cast<double>(costs_.size()) * beyond(i, looks_beyond_ ? kManyLegs : 0);
    const auto [known, is_new] = least_.try_emplace({i, slice}, 0.0);
    if (!is_new) return known->second;
    double least = from(cell, slice + 1);
    for (uint32_t j = 0; j < block_.clearance_m.size(); ++j) least = std::min(least, by_leg(i, j, slice));
    return least_[{i, slice}] = costs_[slice][i] + least;
  }
  bool can_fly(uint32_t i, uint32_t j) const {
    const glm::ivec3 way = glm::abs(block_.cell(i) - block_.cell(j));
    const double length_m = glm::distance(block_.position_m[i], block_.position_m[j]);
    return i != j && std::max({way.x, way.y, way.z}) == 1 && block_.clearance_m[i] >= body_m_ &&
           block_.clearance_m[j] >= body_m_ && block_.clearance_m[i] + block_.clearance_m[j] > length_m;
  }

 private:
  double by_leg(uint32_t i, uint32_t j, size_t slice) {
    if (!can_fly(i, j)) return std::numeric_limits<double>::infinity();
    const double length_m = glm::distance(block_.at(block_.cell(i)), block_.at(block_.cell(j)));
    const double takes = std::max(1.0, length_m / settings_.speed_mps / settings_.slice_s),
                 rest = takes - std::floor(takes);
    const size_t before = slice + static_cast<size_t>(takes);
    return settings_.route * static_cast<double>(costs_.size()) * length_m +
           (1 - rest) * arriving(i, j, slice, before) + rest * arriving(i, j, slice, before + 1);
  }
  double arriving(uint32_t i, uint32_t j, size_t slice, size_t arrival) {
    double cost = from(block_.cell(j), arrival);
    for (size_t k = slice + 1; k < std::min(arrival, costs_.size()); ++k) cost += (costs_[k][i] + costs_[k][j]) / 2;
    return cost;
  }

  const Block& block_;
  const Costs& costs_;
  const FlightSettings& settings_;
  const double body_m_;
  const bool looks_beyond_;
  std::map<std::pair<uint32_t, size_t>, double> least_;
  std::map<std::pair<uint32_t, int>, double> beyond_;
};

TEST(FlightPlan, IsTheCheapestOfAllWays) {
  FlightPlanner planner;
  for (uint64_t seed = 1; seed <= 60; ++seed) {
    CounterRandom random(seed, 0, RandomPurpose::kTest);
    Block block({3 + static_cast<int>(random.next_below(3)), 1 + static_cast<int>(random.next_below(3)), 3});
    for (float& clearance : block.clearance_m) clearance = static_cast<float>(random.next_in(0.1, 1.2));
    const size_t slices = 3 + random.next_below(6);
    Costs costs = always(block, slices, 0);
    for (auto& of_slice : costs)
      for (float& cost : of_slice) cost = random.next_below(3) == 0 ? 0.0f : static_cast<float>(random.next_in(0, 20));
    const FlightSettings settings{.slice_s = 0.1,
                                  .speed_mps = random.next_in(1.5, 9),
                                  .route = random.next_in(0, 1),
                                  .afterwards = random.next_in(0, 1)};
    const glm::ivec3 home(1, 0, 1);
    block.clearance_m[block.index(home)] = kWideM;
    if (seed % 2 == 0)  // places off the middle of their cells
      for (glm::dvec3& place_m : block.position_m)
        if (random.next_below(3) == 0)
          place_m += glm::dvec3(random.next_in(-0.14, 0.14), random.next_in(-0.14, 0.14), random.next_in(-0.14, 0.14));
    const double body_m = seed % 3 == 0 ? 0.46 : 0.3;  // a large body leaves no leg on which a wall could stand
    const bool looks_beyond = seed % 5 < 3;
    const FlightPlan& plan = planned(planner, block, costs, {.position_m = block.at(home)}, settings, body_m, 0.0,
                                     looks_beyond);

    EveryWay ways(block, costs, settings, body_m, looks_beyond);
    double least = std::numeric_limits<double>::infinity();
    for (uint32_t i = 0; i < block.clearance_m.size(); ++i) {
      const glm::ivec3 way = glm::abs(block.cell(i) - home);
      if (std::max({way.x, way.y, way.z}) > 1 || block.clearance_m[i] < body_m) continue;
      const double length_m = glm::distance(block.at(home), block.position_m[i]);
      const auto arrival = std::min(static_cast<size_t>(std::lround(length_m / settings.speed_mps / settings.slice_s)),
                                    slices - 1);
      double cost = settings.route * static_cast<double>(slices) * length_m + ways.from(block.cell(i), arrival);
      for (size_t k = 0; k < arrival; ++k) cost += costs[k][i];
      least = std::min(least, cost);
    }
    EXPECT_NEAR(plan.cost, least / static_cast<double>(slices), 1e-4 * (1 + least)) << "seed " << seed;
    for (size_t k = 0; k < plan.candidates.size(); ++k)
      EXPECT_LT(glm::distance(plan.point_m[k + 1], block.position_m[plan.candidates[k]]), 1e-6) << "seed " << seed;
    for (size_t k = 1; k < plan.candidates.size(); ++k)
      EXPECT_TRUE(plan.candidates[k - 1] == plan.candidates[k] ||
                  ways.can_fly(plan.candidates[k - 1], plan.candidates[k]))
          << "seed " << seed;
  }
}

TEST(FlightPlan, LooksBeyondItsLastSlice) {
  FlightPlanner planner;
  double gained = 0;
  for (uint64_t seed = 1; seed <= 30; ++seed) {
    CounterRandom random(seed, 0, RandomPurpose::kTest);
    Block block({6, 1 + static_cast<int>(random.next_below(2)), 5});
    for (float& clearance : block.clearance_m) clearance = static_cast<float>(random.next_in(0.2, 1.2));
    Costs costs = always(block, 2, 80);  // in the dark but for a few places
    for (float& cost : costs.back())
      if (random.next_below(10) == 0) cost = 0;
    const FlightSettings settings{.speed_mps = random.next_in(1.5, 9), .route = random.next_in(0, 1)};
    planned(planner, block, costs, {.position_m = block.at({2, 0, 2})}, settings, 0.3, 0.0, true);
    EveryWay ways(block, costs, settings, 0.3, true);
    for (uint32_t i = 0; i < block.clearance_m.size(); ++i) {
      if (block.clearance_m[i] < 0.3f) continue;
      const double expected = ways.beyond(i, kManyLegs);
      EXPECT_NEAR(planner.sight_beyond(i), expected, 1e-3) << "seed " << seed << ", place " << i;
      gained += costs.back()[i] - expected;
    }
  }
  EXPECT_GT(gained, 1000);
}

// A long way in the dark, and light at its end that no plan reaches in time.
TEST(FlightPlan, LeadsThroughTheDarkTowardsALightBeyondItsEnd) {
  FlightPlanner planner;
  const Block block({12, 1, 1});
  Costs costs = always(block, 4, 80);
  for (auto& of_slice : costs) of_slice[block.index({11, 0, 0})] = 0;
  const FlightStart start{.position_m = block.at({4, 0, 0})};
  const FlightSettings settings{.speed_mps = 5};
  EXPECT_EQ(planned(planner, block, costs, start, settings).candidates.back(), block.index({4, 0, 0}));
  EXPECT_EQ(planned(planner, block, costs, start, settings, 0.3, 0.0, true).candidates.back(), block.index({7, 0, 0}));
}

TEST(FlightPlan, FindsTheWayToTheNearestWantedPlace) {
  FlightPlanner planner;
  Block block({7, 1, 5});
  std::vector<uint32_t> way;
  const auto finds = [&](const std::vector<glm::ivec3>& wanted) {
    planned(planner, block, always(block, 3, 1), {.position_m = block.at({1, 0, 1})}, {});
    way.assign(1, block.index({1, 0, 1}));
    return planner.append_way(
        way[0], [&](uint32_t candidate) { return std::ranges::find(wanted, block.cell(candidate)) != wanted.end(); },
        way);
  };
  for (int z = 0; z < 4; ++z) block.clearance_m[block.index({3, 0, z})] = 0.1f;  // open at z = 4 only
  EXPECT_TRUE(finds({{5, 0, 1}}));
  EXPECT_EQ(way.size(), 7u) << "three legs to the gap, and three from there";
  EXPECT_EQ(way[3], block.index({3, 0, 4}));
  EXPECT_EQ(way.back(), block.index({5, 0, 1}));
  for (size_t k = 1; k < way.size(); ++k)
    EXPECT_LE(glm::length(glm::dvec3(block.cell(way[k]) - block.cell(way[k - 1]))), std::sqrt(3.0) + 1e-9);
  EXPECT_TRUE(finds({{5, 0, 1}, {1, 0, 1}}));
  EXPECT_EQ(way.size(), 1u) << "it is there";
  EXPECT_TRUE(finds({{4, 0, 1}, {1, 0, 4}}));
  EXPECT_EQ(way.back(), block.index({1, 0, 4})) << "the way to the other leads round the wall";
  block.clearance_m[block.index({3, 0, 4})] = 0.1f;
  EXPECT_FALSE(finds({{5, 0, 1}}));
  EXPECT_EQ(way.size(), 1u);
}

TEST(FlightPlan, ABlurredCostIsMixedWithTheMeanOfTheOpenCellsAround) {
  FlightPlanner planner;
  CounterRandom random(7, 0, RandomPurpose::kTest);
  Block block({5, 4, 3});
  for (float& clearance : block.clearance_m) clearance = random.next_below(4) == 0 ? 0.1f : kWideM;
  Costs costs = always(block, 2, 0);
  for (auto& of_slice : costs)
    for (float& cost : of_slice) cost = static_cast<float>(random.next_in(0, 50));
  constexpr double kShare = 0.3;
  planned(planner, block, costs, {.position_m = block.at({2, 2, 1})}, {}, 0.3, kShare);
  for (size_t slice = 0; slice < costs.size(); ++slice)
    for (uint32_t i = 0; i < block.clearance_m.size(); ++i) {
      if (block.clearance_m[i] < 0.3f) continue;
      double sum = 0;
      int open = 0;
      for (uint32_t j = 0; j < block.clearance_m.size(); ++j) {
        const glm::ivec3 apart = glm::abs(block.cell(i) - block.cell(j));
        if (std::max({apart.x, apart.y, apart.z}) > 1 || block.clearance_m[j] < 0.3f) continue;
        sum += costs[slice][j], ++open;
      }
      EXPECT_NEAR(planner.costs(slice)[planner.cell_of(i)], (1 - kShare) * costs[slice][i] + kShare * sum / open, 1e-4)
          << i;
    }
}

TEST(FlightPlan, LeavesBeforeItsPlaceGoesBad) {
  FlightPlanner planner;
  const Block block({9, 1, 1});
  Costs costs = always(block, 10, 0);
  for (size_t slice = 5; slice < costs.size(); ++slice)  // half a second from now the first six cells are hidden
    for (uint32_t i = 0; i < 6; ++i) costs[slice][i] = 80;
  const FlightPlan plan = planned(planner, block, costs, {.position_m = block.at({2, 0, 0})},
                                  {.speed_mps = 5, .route = 0.3});
  EXPECT_GE(plan.at(0.6).x, block.at({6, 0, 0}).x) << "it is there when the others are hidden";
  EXPECT_GT(plan.at(0.4).x, block.at({2, 0, 0}).x) << "it has left before";
}

TEST(FlightPlan, PassesABadPlaceRatherThanWaitingForIt) {
  FlightPlanner planner;
  const Block block({5, 1, 1});
  Costs costs = always(block, 12, 80);
  for (auto& of_slice : costs) of_slice[4] = 0, of_slice[2] = 100;
  const FlightPlan plan = planned(planner, block, costs, {.position_m = block.at({0, 0, 0})}, {.speed_mps = 5});
  EXPECT_EQ(plan.candidates.back(), 4u);
}

// The only good cell lies two cells away, along each of the 26 legs in turn. Every leg takes one slice, so two slices
// are bad.
TEST(FlightPlan, EveryLegLeadsToTheCellsBeyond) {
  FlightPlanner planner;
  const Block block({5, 5, 5});
  const glm::ivec3 middle(2);
  const FlightSettings settings{.slice_s = 0.1, .speed_mps = 9, .route = 2, .afterwards = 0.5};
  // only the small body has legs that a wall could cross along each number of axes
  for (const double body_m : {0.1, 0.3, 0.46})
    for (uint32_t i = 0; i < 27; ++i) {
      const glm::ivec3 leg(static_cast<int>(i % 3) - 1, static_cast<int>(i / 3 % 3) - 1, static_cast<int>(i / 9) - 1);
      if (leg == glm::ivec3(0)) continue;
      const uint32_t good = block.index(middle + 2 * leg);
      Costs costs = always(block, 6, 60);
      for (auto& of_slice : costs) of_slice[good] = 0;
      const FlightPlan& plan = planned(planner, block, costs, {.position_m = block.at(middle)}, settings, body_m);
      ASSERT_FALSE(plan.candidates.empty());
      EXPECT_EQ(plan.candidates.back(), good);
      EXPECT_NEAR(plan.cost, 2 * 60.0 / 6 + 2 * glm::length(block.at(2 * leg)), 1e-4)
          << leg.x << ' ' << leg.y << ' ' << leg.z << ", body " << body_m;
    }
}

TEST(FlightPlan, StaysWhereGoingGainsNothing) {
  FlightPlanner planner;
  const Block block({5, 3, 5});
  const FlightPlan plan = planned(planner, block, always(block, 12, 7), {.position_m = block.at({2, 1, 2})}, {});
  for (const uint32_t candidate : plan.candidates) EXPECT_EQ(candidate, block.index({2, 1, 2}));
  EXPECT_NEAR(plan.cost, 7 * 1.3, 1e-5) << "every slice, and three tenths of a plan for the time after it";
}

TEST(FlightPlan, LeadsRoundAWall) {
  FlightPlanner planner;
  Block block({7, 1, 5});
  for (int z = 0; z < 4; ++z) block.clearance_m[block.index({3, 0, z})] = 0.1f;  // open at z = 4 only
  Costs costs = always(block, 12, 10);
  for (auto& of_slice : costs) of_slice[block.index({5, 0, 1})] = 0;
  const FlightPlan plan = planned(planner, block, costs, {.position_m = block.at({1, 0, 1})},
                                  {.speed_mps = 10, .route = 0.01});
  EXPECT_EQ(plan.candidates.back(), block.index({5, 0, 1}));
  for (const uint32_t candidate : plan.candidates) EXPECT_GE(block.clearance_m[candidate], 0.3f);
}

// A thin sheet lies half way between two cells whose body fits on each side.
TEST(FlightPlan, NoLegCrossesASheetBetweenItsEnds) {
  FlightPlanner planner;
  Block block({2, 1, 1});
  block.clearance_m = {0.24f, 0.24f};
  Costs costs = always(block, 6, 0);
  for (auto& of_slice : costs) of_slice[0] = 50;
  const FlightStart start{.position_m = block.at({0, 0, 0}),
                          .is_free = [](uint32_t candidate) { return candidate == 0; }};
  EXPECT_EQ(planned(planner, block, costs, start, {}, 0.2).candidates.back(), 0u);
  block.clearance_m = {0.26f, 0.26f};
  EXPECT_EQ(planned(planner, block, costs, start, {}, 0.2).candidates.back(), 1u);
}

TEST(FlightPlan, IsTheStartAloneWhereNoCellCanBeReached) {
  FlightPlanner planner;
  const Block block({3, 3, 3});
  const FlightStart walled_in{.position_m = block.at({1, 1, 1}), .is_free = [](uint32_t) { return false; }};
  const FlightPlan& plan = planned(planner, block, always(block, 4, 1), walled_in, {});
  EXPECT_TRUE(plan.candidates.empty());
  EXPECT_EQ(plan.at(0.3), block.at({1, 1, 1}));
}

TEST(FlightPlan, PrefersAPlaceWhoseSurroundingsAreGoodToo) {
  FlightPlanner planner;
  const Block block({9, 1, 5});
  Costs costs = always(block, 12, 40);
  for (auto& of_slice : costs) {
    of_slice[block.index({1, 0, 2})] = 0;  // a gap of one cell
    for (int x = 6; x <= 8; ++x)
      for (int z = 1; z <= 3; ++z) of_slice[block.index({x, 0, z})] = 0;
  }
  const FlightStart start{.position_m = block.at({4, 0, 2})};
  const FlightSettings settings{.speed_mps = 10, .route = 0.01};
  EXPECT_EQ(planned(planner, block, costs, start, settings, 0.3, 0.5).candidates.back(), block.index({7, 0, 2}));
}

TEST(FlightPlan, CostsBetweenCellsAreInterpolatedFromOpenOnes) {
  FlightPlanner planner;
  Block block({2, 2, 2});
  Costs costs = always(block, 1, 4);
  costs[0][block.index({1, 0, 0})] = 12;
  planned(planner, block, costs, {}, {});
  EXPECT_NEAR(planner.cost_at({0.25 * kSpacingM, 0, 0}, 0, -1), 6, 1e-5);
  block.clearance_m[block.index({1, 0, 0})] = 0;
  planned(planner, block, costs, {}, {});
  EXPECT_NEAR(planner.cost_at({0.25 * kSpacingM, 0, 0}, 0, -1), 4, 1e-5);
  EXPECT_EQ(planner.cost_at({99, 0, 0}, 0, -1), -1);
}

}  // namespace
}  // namespace sightline
