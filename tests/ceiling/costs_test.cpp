// The dynamic program against a search of all paths.
#include "client/ceiling/costs_to_go.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

namespace sightline {
namespace {

using Random = std::mt19937_64;

struct Problem {
  PlaceGraph graph;
  std::vector<std::vector<float>> cost;  // by stage, then by place
  int hops = 1;
};

double length_between(const PlaceGraph& graph, uint32_t a, uint32_t b) {
  for (uint32_t edge = graph.first[a]; edge < graph.first[a + 1]; ++edge)
    if (graph.to[edge] == b) return graph.length_m[edge];
  return -1.0;
}

Problem random_problem(Random& random) {
  const auto up_to = [&](uint32_t most) { return std::uniform_int_distribution<uint32_t>(0, most)(random); };
  Problem problem;
  const uint32_t places = 2 + up_to(3);
  std::vector<std::vector<float>> length_m(places, std::vector<float>(places, 0.0f));
  for (uint32_t a = 0; a < places; ++a)
    for (uint32_t b = 0; b < a; ++b)
      if (up_to(1) == 1) length_m[a][b] = length_m[b][a] = 0.25f + static_cast<float>(up_to(4));
  for (uint32_t a = 0; a < places; ++a) {
    for (uint32_t b = 0; b < places; ++b)
      if (length_m[a][b] > 0) problem.graph.to.push_back(b), problem.graph.length_m.push_back(length_m[a][b]);
    problem.graph.first.push_back(static_cast<uint32_t>(problem.graph.to.size()));
  }
  problem.cost.assign(1 + up_to(2), std::vector<float>(places));
  for (auto& stage : problem.cost)
    for (float& cost : stage) cost = up_to(7) == 0 ? kBarredCost : static_cast<float>(up_to(3));
  problem.hops = static_cast<int>(up_to(2));
  return problem;
}

// Tries every path.
double least_cost(const Problem& problem, double per_m, uint32_t place, size_t stage, int hops_left);

double least_cost_at(const Problem& problem, double per_m, uint32_t place, size_t stage) {
  const double here = problem.cost[stage][place];
  return stage + 1 == problem.cost.size() ? here : here + least_cost(problem, per_m, place, stage, problem.hops);
}

// On the way from `stage` to the next, with so many edges left to go.
double least_cost(const Problem& problem, double per_m, uint32_t place, size_t stage, int hops_left) {
  double least = least_cost_at(problem, per_m, place, stage + 1);
  const bool passing = hops_left > 0 && hops_left < problem.hops;
  if (hops_left == 0 || (passing && problem.cost[stage + 1][place] >= kBarredCost)) return least;
  for (uint32_t to = 0; to < problem.graph.size(); ++to)
    if (const double length_m = length_between(problem.graph, place, to); length_m > 0)
      least = std::min(least, per_m * length_m + least_cost(problem, per_m, to, stage, hops_left - 1));
  return least;
}

TEST(CostsToGo, AreThoseOfTheBestOfAllPaths) {
  Random random(3);
  int moved = 0;
  for (int run = 0; run < 300; ++run) {
    const Problem problem = random_problem(random);
    CostsToGo costs(problem.graph, 0.125);
    for (size_t stage = problem.cost.size(); stage-- > 0;) {
      costs.add_stage_before(problem.cost[stage], problem.hops);
      for (uint32_t place = 0; place < problem.graph.size(); ++place) {
        const double least = least_cost_at(problem, 0.125, place, stage);
        if (least >= kBarredCost) {
          ASSERT_GE(costs.costs()[place], kBarredCost) << "run " << run;
          continue;
        }
        ASSERT_FLOAT_EQ(costs.costs()[place], static_cast<float>(least)) << "run " << run;
        moved += least != std::round(least);
      }
    }
  }
  EXPECT_GT(moved, 100) << "paths that go somewhere have a length that is no whole number of pictures";
}

TEST(CostsToGo, WithoutHopsAreTheSumsOfEachPlace) {
  Random random(4);
  Problem problem = random_problem(random);
  CostsToGo costs(problem.graph, 1.0);
  std::vector<float> sum(problem.graph.size(), 0.0f);
  for (int stage = 0; stage < 5; ++stage) {
    costs.add_stage_before(problem.cost[0], 0);
    for (size_t place = 0; place < sum.size(); ++place) sum[place] += problem.cost[0][place];
  }
  EXPECT_TRUE(std::equal(sum.begin(), sum.end(), costs.costs().begin(), costs.costs().end()));
}

}  // namespace
}  // namespace sightline
