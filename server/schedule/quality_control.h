// Chooses the quality level of one session's steps and keeps the session's place in the shares of the threads.
//
// FairShares says how much of the threads' time the session may use, StepBudget at which level its steps fit into
// that time. A client may set the level itself (StepControl). StepBudget does not learn from such a step, which says
// nothing about the cost at other levels.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "server/schedule/fair_shares.h"
#include "server/schedule/step_budget.h"

namespace sightline {

// Deterministic apart from the shares of the other sessions. Not thread-safe.
class QualityControl {
 public:
  // Joins `shares`, which must outlive it, as a session of this client, and leaves them when it is destroyed.
  QualityControl(const BudgetRules& rules, FairShares& shares, const std::string& client)
      : budget_(rules), shares_(shares), slot_(shares.join(client)) {}
  ~QualityControl() { shares_.leave(slot_); }
  QualityControl(const QualityControl&) = delete;
  QualityControl& operator=(const QualityControl&) = delete;

  // The level of the step that begins now: `chosen` by the client, or the budget's.
  int begin_step(std::optional<int> chosen) {
    chosen_ = chosen;
    return chosen.value_or(budget_.level());
  }

  // Times of a finished step. All are nanoseconds of the scheduler's clock.
  struct StepTimes {
    int64_t end_ns = 0;       // when its reply was ready
    int64_t due_ns = 0;       // its deadline
    int64_t cost_ns = 0;      // time of a thread that it took
    int64_t interval_ns = 1;  // between the session's ticks, > 0
    bool behind = false;      // ticks come faster than they are stepped (StepBudget::Step::behind)
    bool late() const { return end_ns > due_ns; }
  };
  // Learns from the step that began last. Returns the level before when the level of the next steps has changed.
  std::optional<int> finish_step(const StepTimes& step);

  // The budget's level, which the client's choice does not change.
  int level() const { return budget_.level(); }
  // Cost of the last step; 0 before the first.
  int64_t last_cost_ns() const { return last_cost_ns_; }
  // Expected cost of a step at level 0; 0 before the first step.
  double full_cost_ns() const { return budget_.full_cost_ns(); }

 private:
  StepBudget budget_;
  FairShares& shares_;
  const FairShares::Slot slot_;
  std::optional<int> chosen_;  // level of the step that began last
  int64_t last_cost_ns_ = 0;
};

}  // namespace sightline
