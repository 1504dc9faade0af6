#include "server/schedule/quality_control.h"

#include <algorithm>

namespace sightline {

std::optional<int> QualityControl::finish_step(const StepTimes& step) {
  last_cost_ns_ = step.cost_ns;
  const double cost_ns = chosen_ ? static_cast<double>(step.cost_ns) : budget_.full_cost_ns();
  const double demand = std::min(cost_ns / static_cast<double>(step.interval_ns), 1.0);
  const double share = shares_.report(slot_, demand, step.late(), step.end_ns);
  if (chosen_) return std::nullopt;
  const int former = budget_.level();
  budget_.stepped({.end_ns = step.end_ns,
                   .cost_ns = step.cost_ns,
                   .interval_ns = step.interval_ns,
                   .behind = step.behind,
                   .share = share});
  return budget_.level() == former ? std::nullopt : std::optional(former);
}

}  // namespace sightline
