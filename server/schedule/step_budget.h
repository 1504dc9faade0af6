// How much of its work a session leaves out so that its replies come in time: the level of economy (server/step/quality_level.h)
// of its next step, from what its steps have cost so far and what they may cost.
//
// Nothing is left out while the session keeps up. It has to be over its budget without a break for kRaiseAfterNs, and
// behind its ticks; one slow step, or one slow moment of the machine, changes nothing. A client that waits for each
// reply before it sends the next tick is never cut: it is as fast as the server by itself. A budget that was set by
// hand holds for whoever keeps up, too.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "server/step/quality_level.h"

namespace sightline {

struct BudgetRules {
  bool degrade = true;              // false: level 0 for ever
  std::optional<int64_t> fixed_ns;  // what a step may cost at most, set by hand
  // Of its interval, what a session may use at most: the rest is for its transport.
  double largest_share = 0.85;
};

// Deterministic; knows no clock. Not thread-safe.
class StepBudget {
 public:
  static constexpr int64_t kRaiseAfterNs = 500'000'000;
  static constexpr int64_t kLowerAfterNs = 1'000'000'000;
  static constexpr int64_t kLongestLowerAfterNs = 16'000'000'000;  // after coming back too soon several times
  static constexpr double kLowerBelow = 0.8;  // of the budget, expected at the lower level
  static constexpr uint64_t kLeastSteps = 8;  // at a level, before anything is said about its cost
  static constexpr int kLeastBehind = 2;      // steps that were behind

  explicit StepBudget(const BudgetRules& rules) : rules_(rules) {}

  // Of the next step.
  int level() const { return level_; }

  struct Step {
    int64_t end_ns = 0;       // when it was done
    int64_t cost_ns = 0;      // of a thread's time; taken at level()
    int64_t interval_ns = 1;  // of the session's ticks, > 0
    bool behind = false;      // it answered for more than one tick, or the next had come before it was done
    double share = 1.0;       // of a thread that the session may use, as FairShares says it
  };
  // A step was taken at level().
  void stepped(const Step& step);

  // What a step with nothing left out costs, as far as it is known, nanoseconds; 0 before the first.
  double full_cost_ns() const { return mean_ns_ / relative_[static_cast<size_t>(level_)]; }

 private:
  double budget_ns(const Step& step) const;
  int least_level(double budget_ns) const;
  void learn(int64_t cost_ns);
  void remember(double cost_ns);
  void go_to(int level);
  void consider_raise(const Step& step);
  void consider_lower(const Step& step);

  const BudgetRules rules_;
  int level_ = 0;
  // Of the last steps at this level, without the eighth that cost most: a step that the machine interrupted tells
  // nothing.
  static constexpr size_t kRemembered = 16;
  std::array<double, kRemembered> costs_ns_{};
  double mean_ns_ = 0.0;
  uint64_t steps_ = 0;  // at this level
  // By level, what a step costs beside one of level 0: guesses, until the level has been tried.
  std::array<double, kLowestQualityLevel + 1> relative_ = guesses();
  double former_mean_ns_ = 0.0;  // at the level before this one, and which that was
  int former_level_ = 0;
  bool compared_ = true;  // this level with the former one

  std::optional<int64_t> over_since_ns_, under_since_ns_;
  int behind_ = 0;  // steps that were, since over_since_ns_
  std::optional<int64_t> lowered_ns_;
  int64_t lower_after_ns_ = kLowerAfterNs;

  static std::array<double, kLowestQualityLevel + 1> guesses();
};

}  // namespace sightline
