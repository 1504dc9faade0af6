#include "server/move/goal.h"

#include <algorithm>
#include <cstdlib>
#include <limits>

namespace sightline {
namespace {

// Added to the cost of candidates outside the limits, metres, so that all candidates inside come first.
constexpr double kOutsideLimits = 1e4;

class LeastCost {
 public:
  explicit LeastCost(const GoalInput& input)
      : input_(input), full_depth_steps_(input.costs.full_depth_steps()) {}

  void consider(uint32_t candidate, double route_m) {
    const double cost = cost_of(candidate, route_m);
    if (cost > least_ || (cost == least_ && candidate > goal_)) return;
    least_ = cost, goal_ = candidate;
  }
  // Returns whether the candidate could still be the goal if its route is `route_m` or longer.
  bool may_win(uint32_t candidate, double route_m) const {
    return input_.costs.least_of(candidate, route_m) <= least_ && cost_of(candidate, route_m) <= least_;
  }
  uint32_t goal() const { return goal_; }

 private:
  // Never less with a longer route, not even by rounding.
  double cost_of(uint32_t candidate, double route_m) const {
    const uint32_t depth_squared = input_.edge_depths.squared(candidate, full_depth_steps_);
    const double cost = input_.costs.of(candidate, route_m, depth_squared);
    return input_.limits.hold(input_.position_m[candidate]) ? cost : cost + kOutsideLimits;
  }

  const GoalInput& input_;
  const uint32_t full_depth_steps_;
  double least_ = std::numeric_limits<double>::infinity();
  uint32_t goal_ = UINT32_MAX;
};

}  // namespace

void EdgeDepths::begin(std::span<const glm::ivec3> cell, std::span<const uint8_t> member) {
  cell_ = cell, member_ = member;
  first_.clear(cell);
  for (size_t i = 0; i < cell.size(); ++i)
    if (int32_t& slot = first_.slot_of(cell[i]); slot < 0) slot = static_cast<int32_t>(i);
}

bool EdgeDepths::is_member(const glm::ivec3& cell) const {
  const int32_t first = first_.candidate_in(cell);
  return first >= 0 && member_[static_cast<size_t>(first)] != 0;
}

// Looks at one cubic shell of cells after the other. No cell of shell `way` is nearer than `way`, so the search ends at the first shell
// that is no nearer than the nearest cell found. It never leaves the table, whose rim has no members.
uint32_t EdgeDepths::squared(size_t candidate, uint32_t enough_steps) const {
  const glm::ivec3 at = cell_[candidate];
  if (member_[candidate] == 0 || !is_member(at)) return 0;
  uint32_t least = enough_steps * enough_steps;
  const auto look_at = [&](int x, int y, int z) {
    const auto squared = static_cast<uint32_t>(x * x + y * y + z * z);
    if (squared < least && !is_member(at + glm::ivec3(x, y, z))) least = squared;
  };
  for (int way = 1; static_cast<uint32_t>(way * way) < least; ++way)
    for (int z = -way; z <= way; ++z)
      for (int y = -way; y <= way; ++y) {
        const bool side = std::max(std::abs(z), std::abs(y)) == way;
        for (int x = -way; x <= way; x += side ? 1 : 2 * way) look_at(x, y, z);
      }
  return least;
}

uint32_t find_goal(const GoalInput& input, RouteFinder& routes) {
  const auto count = static_cast<uint32_t>(input.position_m.size());
  LeastCost least(input);
  uint32_t next = 0;  // candidates before it are settled, or cannot win any more
  while (const auto settled = routes.settle_next()) {
    const double route_m = routes.cost_m(*settled);
    least.consider(*settled, route_m);
    while (next < count && !(routes.is_open(next) && least.may_win(next, route_m))) ++next;
    if (next == count) break;
  }
  return least.goal();
}

}  // namespace sightline
