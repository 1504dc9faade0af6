#include "server/move/cost.h"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <vector>

#include "server/base/random.h"

namespace sightline {
namespace {

// Candidates with every quantity that a cost depends on.
struct CostCase {
  std::vector<glm::dvec3> position_m;
  std::vector<double> hidden, route_m, cost;
  std::vector<uint32_t> depth_squared;
  double spacing_m = 0.5;
  glm::dvec3 desired_m{0.0};
  std::optional<glm::dvec3> former_goal_m;

  void add(const glm::dvec3& at, double share, double way_m, uint32_t deep_squared) {
    position_m.push_back(at), hidden.push_back(share), route_m.push_back(way_m);
    depth_squared.push_back(deep_squared);
  }
  CandidateCosts costs(const CostWeights& settings) const {
    return {{.position_m = position_m,
             .hidden = hidden,
             .spacing_m = spacing_m,
             .desired_m = desired_m,
             .former_goal_m = former_goal_m},
            settings};
  }
  const std::vector<double>& of(const CostWeights& settings) {
    cost.clear();
    for (size_t i = 0; i < position_m.size(); ++i)
      cost.push_back(costs(settings).of(i, route_m[i], depth_squared[i]));
    return cost;
  }
};

CostWeights nothing() {
  return {.occlusion = 0,
          .tolerance = 0,
          .distance = 0,
          .edge_penalty = 0,
          .full_depth_m = 1,
          .route = 0,
          .exposure = 0,
          .steadiness = 0};
}

TEST(CandidateCosts, HiddenCountsByItsShare) {
  CostCase given;
  given.add({1, 2, 3}, 0.0, 0, 0), given.add({1, 2, 3}, 0.25, 0, 0), given.add({1, 2, 3}, 1.0, 0, 0);
  CostWeights settings = nothing();
  settings.occlusion = 80;
  EXPECT_EQ(given.of(settings), (std::vector<double>{0, 20, 80}));
}

TEST(CandidateCosts, HiddenCountsByWhatItIsOverTheTolerance) {
  CostCase given;
  for (const double share : {0.0, 0.2, 0.25, 0.75, 1.0}) given.add({}, share, 0, 0);
  CostWeights settings = nothing();
  settings.occlusion = 80, settings.tolerance = 0.25;
  EXPECT_EQ(given.of(settings), (std::vector<double>{0, 0, 0, 40, 60}));
}

TEST(CandidateCosts, DistanceCountsFromTheDesiredPlace) {
  CostCase given;
  given.desired_m = {1, 2, 3};
  given.add({1, 2, 3}, 0, 0, 0), given.add({1, 5, 7}, 0, 0, 0);
  CostWeights settings = nothing();
  settings.distance = 2;
  EXPECT_EQ(given.of(settings), (std::vector<double>{0, 10}));
}

TEST(CandidateCosts, ShelterCountsUpToTheFullDepth) {
  CostCase given;
  for (const uint32_t depth_squared : {0u, 1u, 4u, 100u}) given.add({}, 0, 0, depth_squared);
  CostWeights settings = nothing();
  settings.edge_penalty = 3, settings.full_depth_m = 2;
  EXPECT_EQ(given.of(settings), (std::vector<double>{3, 3 * 0.75, 3 * 0.5, 0})) << "steps of half a metre";
}

TEST(CandidateCosts, TheWayCounts) {
  CostCase given;
  given.add({}, 0, 0, 0), given.add({}, 0, 7, 0);
  CostWeights settings = nothing();
  settings.route = 0.5;
  EXPECT_EQ(given.of(settings), (std::vector<double>{0, 3.5}));
}

TEST(CandidateCosts, SteadinessCountsUpToAMetreFromTheFormerGoalIfThereIsOne) {
  CostCase given;
  given.add({0, 0, 0}, 0, 0, 0), given.add({0, 0.5, 0}, 0, 0, 0), given.add({9, 0, 0}, 0, 0, 0);
  CostWeights settings = nothing();
  settings.steadiness = 4;
  EXPECT_EQ(given.of(settings), (std::vector<double>{0, 0, 0}));
  given.former_goal_m = glm::dvec3(0.0);
  EXPECT_EQ(given.of(settings), (std::vector<double>{0, 2, 4}));
}

CostCase random_case(uint64_t seed) {
  CounterRandom random(seed, 0, RandomPurpose::kTest);
  CostCase given;
  given.desired_m = {1, 1, 1}, given.former_goal_m = glm::dvec3(0.5, 0, 0);
  for (int i = 0; i < 200; ++i)
    given.add({random.next_in(-2, 2), random.next_in(-2, 2), random.next_in(-2, 2)}, random.next_unit(),
              random.next_in(0, 20), random.next_below(9));
  return given;
}

TEST(CandidateCosts, AreTheSumOfTheirTerms) {
  CostCase given = random_case(41);
  const CostWeights all{
      .occlusion = 70, .distance = 2, .edge_penalty = 3, .full_depth_m = 0.7, .route = 0.4, .steadiness = 5};
  std::vector<double> sum(200, 0.0);
  const auto add_term = [&](double CostWeights::*weight) {
    CostWeights one = nothing();
    one.full_depth_m = all.full_depth_m, one.tolerance = all.tolerance;
    one.*weight = all.*weight;
    for (size_t i = 0; i < sum.size(); ++i) sum[i] += given.of(one)[i];
  };
  for (const auto weight : {&CostWeights::occlusion, &CostWeights::distance, &CostWeights::edge_penalty,
                            &CostWeights::route, &CostWeights::steadiness})
    add_term(weight);
  given.of(all);
  for (size_t i = 0; i < sum.size(); ++i) EXPECT_NEAR(given.cost[i], sum[i], 1e-9);
}

// The search for a goal relies on these bounds, which hold to the last bit.
TEST(CandidateCosts, AreNoLessForALongerWayAndNeverLessThanTheLeast) {
  const CostCase given = random_case(42);
  const CandidateCosts costs = given.costs(
      {.occlusion = 70, .distance = 2, .edge_penalty = 3, .full_depth_m = 0.7, .route = 0.4, .steadiness = 5});
  for (size_t i = 0; i < given.position_m.size(); ++i)
    for (double shorter_m = given.route_m[i]; shorter_m > 1e-3; shorter_m = shorter_m * 0.9) {
      ASSERT_LE(costs.of(i, shorter_m, 4), costs.of(i, std::nextafter(shorter_m, 100.0), 4));
      ASSERT_LE(costs.of(i, shorter_m, 4), costs.of(i, given.route_m[i], 3));
      for (uint32_t depth_squared = 0; depth_squared < 9; ++depth_squared)
        ASSERT_LE(costs.least_of(i, shorter_m), costs.of(i, shorter_m, depth_squared));
    }
}

TEST(CandidateCosts, FullDepthIsTheLeastNumberOfStepsThatCostsNothing) {
  CostCase given;
  given.add({}, 0, 0, 0);
  CostWeights settings = nothing();
  settings.edge_penalty = 1;
  for (const double spacing_m : {0.05, 0.1, 0.2, std::exp2(-1.5), 0.6, 7.0}) {
    given.spacing_m = spacing_m, settings.full_depth_m = 0.6;
    const CandidateCosts costs = given.costs(settings);
    const uint32_t steps = costs.full_depth_steps();
    EXPECT_EQ(costs.of(0, 0, steps * steps), 0.0) << spacing_m;
    EXPECT_EQ(costs.of(0, 0, (steps + 1) * (steps + 1)), 0.0) << spacing_m;
    EXPECT_GT(costs.of(0, 0, (steps - 1) * (steps - 1)), 0.0) << spacing_m;
  }
}

}  // namespace
}  // namespace sightline
