#include "server/aggregate/filter.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace sightline {
namespace {

// So that a share of 0.6 of 10 steps is 6 steps, however 0.6 was rounded.
constexpr double kRounding = 1e-6;

int steps_in(double steps, int least) {
  return static_cast<int>(std::clamp(steps, static_cast<double>(least), static_cast<double>(kHistorySteps)));
}

}  // namespace

int FilterSteps::memory() const {
  return std::max({window, min_occlusion, hold});
}

FilterSteps filter_steps(const FilterSettings& s, double dt_s) {
  const double dt = std::max(dt_s, 1e-9);
  FilterSteps steps;
  steps.window = steps_in(std::round(s.window_s / dt), 1);
  steps.min_occlusion = steps_in(std::ceil(s.min_occlusion_s / dt - kRounding), 1);
  steps.hold = steps_in(std::ceil(s.hold_s / dt - kRounding), 0);
  return steps;
}

JointState joint_state(std::span<const VisibilityRecord> records, uint32_t targets, int n, double alpha) {
  uint64_t rest = newest_steps(std::max(n, 1));
  for (uint32_t t = targets; t != 0; t &= t - 1) rest &= records[std::countr_zero(t)].known;
  const int known = std::popcount(rest);
  JointState kept{0, known > 0};
  // States are visited in the order of their last occurrence. Only a more frequent state replaces the best one, so the
  // search ends when fewer steps are left than the best one has.
  int most = 0;
  while (most < std::popcount(rest)) {
    const int newest = std::countr_zero(rest);
    uint64_t same = rest;
    uint32_t state = 0;
    for (uint32_t t = targets; t != 0; t &= t - 1) {
      const uint64_t visible = records[std::countr_zero(t)].visible;
      const bool seen = visible >> newest & 1u;
      if (seen) state |= t & (~t + 1);
      same &= seen ? visible : ~visible;
    }
    const int count = std::popcount(same);
    if (count > most) most = count, kept.visible_targets = state;
    rest &= ~same;
  }
  if (most < alpha * known - kRounding) kept.visible_targets = 0;
  return kept;
}

VisibleShare visible_share(const VisibilityRecord& record, int steps) {
  const uint64_t window = newest_steps(steps);
  return {std::popcount(record.visible & window), std::popcount(record.known & window)};
}

int occluded_steps(const VisibilityRecord& record) {
  return std::popcount(record.known & newest_steps(std::countr_zero(record.visible)));
}

void update(TargetSwitch& state, const VisibilityRecord& record, uint64_t step, const FilterSteps& steps,
            const FilterSettings& settings) {
  if (!(record.known & 1u)) return;
  const bool seen = record.visible & 1u;
  if ((record.known & newest_steps(steps.memory() + 1)) == 1u) {
    state = {0, seen};
    return;
  }
  const VisibleShare share = visible_share(record, steps.window);
  if (!state.visible) {
    if (seen && share.visible >= settings.visible_threshold * share.known - kRounding)
      state = {step + static_cast<uint64_t>(steps.hold), true};
    return;
  }
  if (step < state.held_until_step || occluded_steps(record) < steps.min_occlusion) return;
  if (share.visible <= settings.hidden_threshold * share.known + kRounding) state.visible = false;
}

}  // namespace sightline
