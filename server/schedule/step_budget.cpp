#include "server/schedule/step_budget.h"

#include <algorithm>

namespace sightline {
namespace {

// Keeps quotients of measured costs finite.
constexpr double kLeastRelative = 0.02;

}  // namespace

StepBudget::Costs StepBudget::first_guesses() {
  Costs guesses{};
  for (int level = 0; level <= kLowestQualityLevel; ++level) guesses[static_cast<size_t>(level)] = expected_cost(level);
  return guesses;
}

void StepBudget::stepped(const Step& step) {
  learn(step.cost_ns);
  if (!rules_.degrade || steps_ < kAveragedSteps) return;
  consider_raise(step);
  if (level_ > 0) consider_lower(step);
}

double StepBudget::budget_ns(const Step& step) const {
  const double own_ns = std::min(step.share, rules_.largest_share) * static_cast<double>(step.interval_ns);
  return rules_.fixed_ns ? std::min(own_ns, static_cast<double>(*rules_.fixed_ns)) : own_ns;
}

int StepBudget::least_level_within(double budget_ns) const {
  int level = 0;
  while (level < kLowestQualityLevel && full_cost_ns() * relative_cost(level) > budget_ns) ++level;
  return level;
}

void StepBudget::learn(int64_t cost_ns) {
  const double weight = 1.0 / static_cast<double>(std::min(++steps_, kAveragedSteps));
  mean_ns_ += weight * (static_cast<double>(std::max<int64_t>(cost_ns, 0)) - mean_ns_);
  if (compared_ || steps_ < kAveragedSteps) return;
  compared_ = true;
  compare_levels();
}

// A higher level never costs more than a lower one, so a measured level also bounds the guesses for the others.
void StepBudget::compare_levels() {
  double& here = relative_cost(level_);
  if (former_mean_ns_ > 0) here = relative_cost(former_level_) * mean_ns_ / former_mean_ns_;
  here = level_ == 0 ? 1.0 : std::clamp(here, kLeastRelative, 1.0);
  for (int level = 1; level < level_; ++level) relative_cost(level) = std::max(relative_cost(level), here);
  for (int level = level_ + 1; level <= kLowestQualityLevel; ++level)
    relative_cost(level) = std::min(relative_cost(level), here);
}

void StepBudget::go_to(int level) {
  former_mean_ns_ = mean_ns_;
  former_level_ = level_;
  // The expected cost, until the first step at this level is measured.
  mean_ns_ *= relative_cost(level) / relative_cost(level_);
  level_ = level;
  steps_ = 0;
  compared_ = false;
  over_since_ns_.reset();
  under_since_ns_.reset();
}

void StepBudget::consider_raise(const Step& step) {
  const int wanted = least_level_within(budget_ns(step));
  if (wanted <= level_) return over_since_ns_.reset();
  if (!over_since_ns_) over_since_ns_ = step.end_ns, behind_ = 0;
  behind_ += step.behind;
  const bool by_hand = rules_.fixed_ns && mean_ns_ > static_cast<double>(*rules_.fixed_ns);
  if (step.end_ns - *over_since_ns_ < kRaiseAfterNs || (behind_ < kLeastBehind && !by_hand)) return;
  const bool too_early = lowered_ns_ && step.end_ns - *lowered_ns_ < 2 * (kRaiseAfterNs + kLowerAfterNs);
  lower_after_ns_ = too_early ? std::min(2 * lower_after_ns_, kLongestLowerAfterNs) : kLowerAfterNs;
  go_to(wanted);
}

void StepBudget::consider_lower(const Step& step) {
  const int wanted = least_level_within(kLowerBelow * budget_ns(step));
  if (wanted >= level_) return under_since_ns_.reset();
  if (!under_since_ns_) under_since_ns_ = step.end_ns;
  if (step.end_ns - *under_since_ns_ < lower_after_ns_) return;
  lowered_ns_ = step.end_ns;
  go_to(wanted);
}

}  // namespace sightline
