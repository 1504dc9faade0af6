#include "server/move/cost.h"

#include <algorithm>
#include <cmath>

#include "server/base/check.h"

namespace sightline {
namespace {

// More than any distance inside a bound: orders places outside the largest group after all inside.
constexpr double kOutsideGroup = 1e6;

}  // namespace

void basic_costs(const PlaceView& places, const glm::dvec3& desired_m, std::vector<double>& cost) {
  cost.resize(places.size());
  for (size_t run = 0; run < places.runs().size(); ++run)
    for (size_t i = places.runs()[run].first; i < places.end_of_run(run); ++i)
      cost[i] = glm::distance(places.in_run(places.runs()[run], i), desired_m);
  for (size_t k = 0; k < places.singles_m().size(); ++k)
    cost[places.in_runs() + k] = glm::distance(places.singles_m()[k], desired_m);
}

void robust_costs(std::span<const glm::dvec3> position_m, const glm::dvec3& desired_m, const Groups& groups,
                  std::span<const uint32_t> shelter_squared, std::vector<double>& cost) {
  basic_costs(position_m, desired_m, cost);
  size_t best = position_m.size();
  for (size_t i = 0; i < position_m.size(); ++i) {
    if (groups.largest == kNoGroup || groups.group_of[i] != groups.largest) continue;
    const bool first = best == position_m.size();
    if (first || shelter_squared[i] > shelter_squared[best] ||
        (shelter_squared[i] == shelter_squared[best] && cost[i] < cost[best]))
      best = i;
  }
  if (best == position_m.size()) return;
  basic_costs(position_m, position_m[best], cost);
  for (size_t i = 0; i < cost.size(); ++i)
    if (groups.group_of[i] != groups.largest) cost[i] += kOutsideGroup;
}

double CandidateCosts::missed_and_far(size_t candidate) const {
  const double missed = std::max(0.0, input_.hidden[candidate] - settings_.tolerance);
  return settings_.occlusion * missed +
         settings_.distance * glm::distance(input_.position_m[candidate], input_.desired_m);
}

double CandidateCosts::of(size_t candidate, double route_m, uint32_t depth_squared) const {
  const double depth_m = std::sqrt(static_cast<double>(depth_squared)) * input_.spacing_m;
  const double bare = 1.0 - std::min(depth_m / settings_.full_depth_m, 1.0);
  double cost = missed_and_far(candidate) + settings_.edge_penalty * bare;
  cost += settings_.route * route_m;
  if (input_.former_goal_m)
    cost += settings_.steadiness *
            std::min(glm::distance(input_.position_m[candidate], *input_.former_goal_m), 1.0);
  return cost;
}

double CandidateCosts::least_of(size_t candidate, double route_m) const {
  return missed_and_far(candidate) + settings_.route * route_m;
}

uint32_t CandidateCosts::full_depth_steps() const {
  constexpr uint32_t kMost =
      1 << 15;  // more than any group of candidates has, and its square is a number still
  auto steps = static_cast<uint32_t>(std::min(settings_.full_depth_m / input_.spacing_m, double{kMost}));
  while (steps < kMost && steps * input_.spacing_m / settings_.full_depth_m < 1.0) ++steps;
  return steps;
}

}  // namespace sightline
