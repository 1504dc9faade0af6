// Chooses the quality level (server/step/quality_level.h) of a session's next step, so that its replies come in time.
// It goes by the cost of the session's steps so far and by the time that a step may take, its budget.
//
// The level is 0, full quality, while the session keeps up. It rises only when the expected cost was above the budget
// for kRaiseAfterNs without a break, and the session was behind its ticks meanwhile. A single slow step, or a short
// stall of the machine, changes nothing. A client that waits for each reply before it sends the next tick is never
// behind and therefore never degraded. A budget that was set by hand also holds for sessions that keep up.
//
// Each constant below was taken away alone in a model of the daemon (tests/schedule/overload_model_test.cpp); its
// comment says what became worse.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "server/step/quality_level.h"

namespace sightline {

struct BudgetRules {
  bool degrade = true;              // false: always level 0
  std::optional<int64_t> fixed_ns;  // longest time that a step may take, when set by hand
  // The share of its tick interval that a session may use at most. The rest is for the transport of its messages.
  double largest_share = 0.85;
};

// Deterministic, and without a clock. Not thread-safe.
class StepBudget {
 public:
  // Time above the budget before the level rises, and below it before the level falls.
  static constexpr int64_t kRaiseAfterNs = 500'000'000;
  static constexpr int64_t kLowerAfterNs = 1'000'000'000;
  // When the level has to rise again soon after it fell, the next fall waits twice as long, but no longer than this.
  // Without that rule, a session whose cost swings by a third every 4 s changes its level six times as often.
  static constexpr int64_t kLongestLowerAfterNs = 16'000'000'000;
  // The level falls only when the expected cost is below this share of the budget. With 1, twenty sessions whose costs
  // swing change their levels twice as often.
  static constexpr double kLowerBelow = 0.8;
  // Steps over which the cost is averaged, and the fewest at a level before it may change.
  static constexpr uint64_t kAveragedSteps = 8;
  // Steps behind the ticks before the level rises. With 1, a third more steps are degraded in a steady overload.
  static constexpr int kLeastBehind = 2;

  explicit StepBudget(const BudgetRules& rules) : rules_(rules) {}

  // The level of the next step.
  int level() const { return level_; }

  struct Step {
    int64_t end_ns = 0;       // when it was done
    int64_t cost_ns = 0;      // time of a thread that it took
    int64_t interval_ns = 1;  // between the session's ticks, > 0
    bool behind = false;      // it answered for several ticks, or the next tick had come before it was done
    double share = 1.0;       // of a thread that the session may use (FairShares)
  };
  // Called after every step, which was taken at level().
  void stepped(const Step& step);

  // Expected cost of a step at level 0, in nanoseconds; 0 before the first step.
  double full_cost_ns() const { return mean_ns_ / relative_cost(level_); }

 private:
  using Costs = std::array<double, kLowestQualityLevel + 1>;
  static Costs first_guesses();
  double& relative_cost(int level) { return relative_[static_cast<size_t>(level)]; }
  double relative_cost(int level) const { return relative_[static_cast<size_t>(level)]; }
  double budget_ns(const Step& step) const;
  int least_level_within(double budget_ns) const;
  void learn(int64_t cost_ns);
  void compare_levels();
  void go_to(int level);
  void consider_raise(const Step& step);
  void consider_lower(const Step& step);

  const BudgetRules rules_;
  int level_ = 0;
  double mean_ns_ = 0.0;  // cost of the last steps at this level
  uint64_t steps_ = 0;    // at this level
  // Cost of a step at each level as a share of the cost at level 0. Guessed until the level was used.
  Costs relative_ = first_guesses();
  double former_mean_ns_ = 0.0;  // mean_ns_ at the former level
  int former_level_ = 0;
  bool compared_ = true;  // this level was compared with the former one

  // The level rises and falls by these.
  std::optional<int64_t> over_since_ns_, under_since_ns_;  // above the budget, or well below it, without a break
  int behind_ = 0;                                         // steps behind the ticks since over_since_ns_
  std::optional<int64_t> lowered_ns_;                      // when the level fell last
  int64_t lower_after_ns_ = kLowerAfterNs;
};

}  // namespace sightline
