#include "server/schedule/step_budget.h"

#include <algorithm>
#include <numeric>

namespace sightline {
namespace {

// No level makes a step as good as free.
constexpr double kLeastRelative = 0.02;

}  // namespace

std::array<double, kLowestQualityLevel + 1> StepBudget::guesses() {
  std::array<double, kLowestQualityLevel + 1> guesses{};
  for (int level = 0; level <= kLowestQualityLevel; ++level)
    guesses[static_cast<size_t>(level)] = expected_cost(level);
  return guesses;
}

void StepBudget::stepped(const Step& step) {
  learn(step.cost_ns);
  if (!rules_.degrade || steps_ < kLeastSteps) return;
  consider_raise(step);
  if (level_ > 0) consider_lower(step);
}

double StepBudget::budget_ns(const Step& step) const {
  const double own_ns = std::min(step.share, rules_.largest_share) * static_cast<double>(step.interval_ns);
  return rules_.fixed_ns ? std::min(own_ns, static_cast<double>(*rules_.fixed_ns)) : own_ns;
}

int StepBudget::least_level(double budget_ns) const {
  int level = 0;
  while (level < kLowestQualityLevel && full_cost_ns() * relative_[static_cast<size_t>(level)] > budget_ns)
    ++level;
  return level;
}

void StepBudget::remember(double cost_ns) {
  costs_ns_[steps_++ % kRemembered] = cost_ns;
  std::array<double, kRemembered> sorted = costs_ns_;
  const size_t known = std::min<size_t>(steps_, kRemembered), kept = known - known / 8;
  std::sort(sorted.begin(), sorted.begin() + known);
  mean_ns_ = std::accumulate(sorted.begin(), sorted.begin() + kept, 0.0) / static_cast<double>(kept);
}

void StepBudget::learn(int64_t cost_ns) {
  remember(static_cast<double>(std::max<int64_t>(cost_ns, 0)));
  if (compared_ || steps_ < kLeastSteps) return;
  compared_ = true;
  auto& now = relative_[static_cast<size_t>(level_)];
  if (former_mean_ns_ > 0) now = relative_[static_cast<size_t>(former_level_)] * mean_ns_ / former_mean_ns_;
  // A higher level costs no more than a lower one, whatever the noise says.
  relative_[0] = 1.0;
  now = level_ == 0 ? 1.0 : std::clamp(now, kLeastRelative, 1.0);
  for (int level = level_ - 1; level > 0; --level)
    relative_[static_cast<size_t>(level)] = std::max(relative_[static_cast<size_t>(level)], now);
  for (int level = level_ + 1; level <= kLowestQualityLevel; ++level)
    relative_[static_cast<size_t>(level)] = std::min(relative_[static_cast<size_t>(level)], now);
}

void StepBudget::go_to(int level) {
  former_mean_ns_ = mean_ns_;
  former_level_ = level_;
  // Until it is measured, what is expected of it.
  mean_ns_ *= relative_[static_cast<size_t>(level)] / relative_[static_cast<size_t>(level_)];
  level_ = level;
  steps_ = 0;
  compared_ = false;
  over_since_ns_.reset();
  under_since_ns_.reset();
}

void StepBudget::consider_raise(const Step& step) {
  const int wanted = least_level(budget_ns(step));
  if (wanted <= level_) return over_since_ns_.reset();
  if (!over_since_ns_) over_since_ns_ = step.end_ns, behind_ = 0;
  behind_ += step.behind;
  const bool by_hand = rules_.fixed_ns && mean_ns_ > static_cast<double>(*rules_.fixed_ns);
  if (step.end_ns - *over_since_ns_ < kRaiseAfterNs || (behind_ < kLeastBehind && !by_hand)) return;
  // Back from a level that was left too early: the next time it is kept for longer.
  const bool too_early = lowered_ns_ && step.end_ns - *lowered_ns_ < 2 * (kRaiseAfterNs + kLowerAfterNs);
  lower_after_ns_ = too_early ? std::min(2 * lower_after_ns_, kLongestLowerAfterNs) : kLowerAfterNs;
  go_to(wanted);
}

void StepBudget::consider_lower(const Step& step) {
  const int wanted = least_level(kLowerBelow * budget_ns(step));
  if (wanted >= level_) return under_since_ns_.reset();
  if (!under_since_ns_) under_since_ns_ = step.end_ns;
  if (step.end_ns - *under_since_ns_ < lower_after_ns_) return;
  lowered_ns_ = step.end_ns;
  go_to(wanted);
}

}  // namespace sightline
