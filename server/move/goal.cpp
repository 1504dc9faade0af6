#include "server/move/goal.h"

#include <limits>

namespace sightline {
namespace {

// Places outside the limits come after all inside.
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
  // False: with no way as long as this, or longer, it is the goal.
  bool may_win(uint32_t candidate, double route_m) const {
    return input_.costs.least_of(candidate, route_m) <= least_ && cost_of(candidate, route_m) <= least_;
  }
  uint32_t goal() const { return goal_; }

 private:
  // Never less with a longer way, not in the last bit.
  double cost_of(uint32_t candidate, double route_m) const {
    const uint32_t depth_squared = input_.depths.squared(candidate, full_depth_steps_);
    const double cost = input_.costs.of(candidate, route_m, depth_squared);
    return input_.limits.hold(input_.position_m[candidate]) ? cost : cost + kOutsideLimits;
  }

  const GoalInput& input_;
  const uint32_t full_depth_steps_;
  double least_ = std::numeric_limits<double>::infinity();
  uint32_t goal_ = UINT32_MAX;
};

}  // namespace

uint32_t find_goal(const GoalInput& input, RouteFinder& routes) {
  const auto count = static_cast<uint32_t>(input.position_m.size());
  LeastCost least(input);
  uint32_t next = 0;  // those before it are settled, or cannot win any more
  while (const auto settled = routes.settle_next()) {
    const double route_m = routes.cost_m(*settled);
    least.consider(*settled, route_m);
    while (next < count && !(routes.is_open(next) && least.may_win(next, route_m))) ++next;
    if (next == count) break;
  }
  return least.goal();
}

}  // namespace sightline
