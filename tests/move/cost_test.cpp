#include "server/move/cost.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "server/base/random.h"

namespace sightline {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Candidates with everything that a blend reads.
struct Blend {
  std::vector<glm::dvec3> position_m;
  std::vector<double> hidden, route_m, cost;
  Groups groups;
  double spacing_m = 0.5;
  glm::dvec3 desired_m{0.0};
  std::optional<glm::dvec3> former_goal_m;

  void add(const glm::dvec3& at, double share, double way_m, uint32_t depth_squared) {
    position_m.push_back(at), hidden.push_back(share), route_m.push_back(way_m);
    groups.depth_squared.push_back(depth_squared),
        groups.group_of.push_back(depth_squared > 0 ? 0 : kNoGroup);
  }
  const std::vector<double>& of(const BlendSettings& settings) {
    blend_costs({.position_m = position_m,
                 .hidden = hidden,
                 .route_m = route_m,
                 .groups = groups,
                 .spacing_m = spacing_m,
                 .desired_m = desired_m,
                 .former_goal_m = former_goal_m},
                settings, cost);
    return cost;
  }
};

BlendSettings nothing() {
  return {.hidden = 0,
          .tolerance = 0,
          .distance = 0,
          .shelter = 0,
          .full_depth_m = 1,
          .route = 0,
          .exposure = 0,
          .steadiness = 0};
}

TEST(BlendCosts, HiddenCountsByItsShare) {
  Blend blend;
  blend.add({1, 2, 3}, 0.0, 0, 0), blend.add({1, 2, 3}, 0.25, 0, 0), blend.add({1, 2, 3}, 1.0, 0, 0);
  BlendSettings settings = nothing();
  settings.hidden = 80;
  EXPECT_EQ(blend.of(settings), (std::vector<double>{0, 20, 80}));
}

TEST(BlendCosts, HiddenCountsByWhatItIsOverTheTolerance) {
  Blend blend;
  for (const double share : {0.0, 0.2, 0.25, 0.75, 1.0}) blend.add({}, share, 0, 0);
  BlendSettings settings = nothing();
  settings.hidden = 80, settings.tolerance = 0.25;
  EXPECT_EQ(blend.of(settings), (std::vector<double>{0, 0, 0, 40, 60}));
}

TEST(BlendCosts, DistanceCountsFromTheDesiredPlace) {
  Blend blend;
  blend.desired_m = {1, 2, 3};
  blend.add({1, 2, 3}, 0, 0, 0), blend.add({1, 5, 7}, 0, 0, 0);
  BlendSettings settings = nothing();
  settings.distance = 2;
  EXPECT_EQ(blend.of(settings), (std::vector<double>{0, 10}));
}

TEST(BlendCosts, ShelterCountsUpToTheFullDepth) {
  Blend blend;
  for (const uint32_t depth_squared : {0u, 1u, 4u, 100u}) blend.add({}, 0, 0, depth_squared);
  BlendSettings settings = nothing();
  settings.shelter = 3, settings.full_depth_m = 2;
  EXPECT_EQ(blend.of(settings), (std::vector<double>{3, 3 * 0.75, 3 * 0.5, 0})) << "steps of half a metre";
}

TEST(BlendCosts, TheWayCountsAndNoWayIsInfiniteWhateverItsWeight) {
  Blend blend;
  blend.add({}, 0, 0, 0), blend.add({}, 0, 7, 0), blend.add({}, 0, kInfinity, 0);
  BlendSettings settings = nothing();
  settings.route = 0.5;
  EXPECT_EQ(blend.of(settings), (std::vector<double>{0, 3.5, kInfinity}));
  settings.route = 0, settings.hidden = 1;
  EXPECT_EQ(blend.of(settings), (std::vector<double>{0, 0, kInfinity}));
}

TEST(BlendCosts, SteadinessCountsUpToAMetreFromTheFormerGoalIfThereIsOne) {
  Blend blend;
  blend.add({0, 0, 0}, 0, 0, 0), blend.add({0, 0.5, 0}, 0, 0, 0), blend.add({9, 0, 0}, 0, 0, 0);
  BlendSettings settings = nothing();
  settings.steadiness = 4;
  EXPECT_EQ(blend.of(settings), (std::vector<double>{0, 0, 0}));
  blend.former_goal_m = glm::dvec3(0.0);
  EXPECT_EQ(blend.of(settings), (std::vector<double>{0, 2, 4}));
}

TEST(BlendCosts, AreTheSumOfTheirTerms) {
  CounterRandom random(41, 0, RandomPurpose::kTest);
  Blend blend;
  blend.desired_m = {1, 1, 1}, blend.former_goal_m = glm::dvec3(0.5, 0, 0);
  for (int i = 0; i < 200; ++i)
    blend.add({random.next_in(-2, 2), random.next_in(-2, 2), random.next_in(-2, 2)}, random.next_unit(),
              random.next_in(0, 20), random.next_below(9));
  const BlendSettings all{
      .hidden = 70, .distance = 2, .shelter = 3, .full_depth_m = 0.7, .route = 0.4, .steadiness = 5};
  std::vector<double> sum(200, 0.0);
  const auto add_term = [&](double BlendSettings::*weight) {
    BlendSettings one = nothing();
    one.full_depth_m = all.full_depth_m, one.tolerance = all.tolerance;
    one.*weight = all.*weight;
    for (size_t i = 0; i < sum.size(); ++i) sum[i] += blend.of(one)[i];
  };
  for (const auto weight : {&BlendSettings::hidden, &BlendSettings::distance, &BlendSettings::shelter,
                            &BlendSettings::route, &BlendSettings::steadiness})
    add_term(weight);
  blend.of(all);
  for (size_t i = 0; i < sum.size(); ++i) EXPECT_NEAR(blend.cost[i], sum[i], 1e-9);
}

TEST(BlendCosts, OfNoCandidatesAreNone) {
  Blend blend;
  blend.cost = {1, 2, 3};
  EXPECT_TRUE(blend.of({}).empty());
}

}  // namespace
}  // namespace sightline
