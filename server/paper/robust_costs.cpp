#include "server/paper/robust_costs.h"

#include <algorithm>
#include <cmath>

#include "server/base/check.h"

namespace sightline {
namespace {

// More than any distance inside a bound. It sorts candidates outside the largest group after all inside.
constexpr double kOutsideGroup = 1e6;

// Makes cost the distance to a place, in the largest group first.
void order_by_distance(std::span<const glm::dvec3> position_m, const glm::dvec3& place_m, const Groups& groups,
                       std::vector<double>& cost) {
  basic_costs(position_m, place_m, cost);
  for (size_t i = 0; i < cost.size(); ++i)
    if (groups.group_of[i] != groups.largest) cost[i] += kOutsideGroup;
}

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
                  std::span<const uint32_t> edge_distance_squared, std::vector<double>& cost) {
  basic_costs(position_m, desired_m, cost);
  size_t best = position_m.size();
  for (size_t i = 0; i < position_m.size(); ++i) {
    if (groups.largest == kNoGroup || groups.group_of[i] != groups.largest) continue;
    const bool first = best == position_m.size();
    if (first || edge_distance_squared[i] > edge_distance_squared[best] ||
        (edge_distance_squared[i] == edge_distance_squared[best] && cost[i] < cost[best]))
      best = i;
  }
  if (best == position_m.size()) return;
  order_by_distance(position_m, position_m[best], groups, cost);
}

glm::dvec3 center_of_largest_m(std::span<const glm::dvec3> position_m, const Groups& groups) {
  glm::dvec3 sum_m(0.0);
  double count = 0;
  for (size_t i = 0; i < position_m.size(); ++i)
    if (groups.group_of[i] == groups.largest) sum_m += position_m[i], count += 1;
  return sum_m / count;
}

void center_costs(std::span<const glm::dvec3> position_m, const glm::dvec3& desired_m, const Groups& groups,
                  std::vector<double>& cost) {
  if (groups.largest == kNoGroup) return basic_costs(position_m, desired_m, cost);
  order_by_distance(position_m, center_of_largest_m(position_m, groups), groups, cost);
}

}  // namespace sightline
