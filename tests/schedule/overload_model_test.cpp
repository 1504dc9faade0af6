// The policies together, in a deterministic model of the daemon on a machine with two CPUs. Leaving a policy out shows
// what it is good for.
//
// Four threads share the CPUs: two scheduler threads, the event loop and one client. The machine runs them in turn, 3
// ms each. Every tick passes the event loop, waits in the queue and is stepped, and its reply passes the event loop. A
// thread that waits for a CPU does no work. The cost of a step is the time between its start and its end, as in the
// daemon.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <deque>
#include <memory>
#include <numbers>
#include <vector>

#include "server/base/random.h"
#include "server/schedule/deadline_queue.h"
#include "server/schedule/quality_control.h"
#include "server/schedule/tick_pace.h"

namespace sightline {
namespace {

constexpr int64_t kGrainNs = 20'000, kIntervalNs = 16'666'667, kSliceNs = 3'000'000;
constexpr size_t kSteppers = 2, kLoop = 2, kClient = 3, kThreads = 4, kCpus = 2;
// Relative cost of a step at each level, on purpose other than the first guesses of StepBudget.
constexpr double kRelativeCost[] = {1.0, 0.8, 0.55, 0.42, 0.28, 0.15};

struct Load {
  size_t sessions = 100;
  double step_us = 80;       // at level 0
  double transport_us = 70;  // of a tick and its reply, for the event loop, and again for the client
  double swing = 0.0;        // the cost of a session's steps swings by this share, every 4 s
  double hard_factor = 1.0;  // from second 5 to 12 all steps cost so many times as much
  size_t greedy = 0;         // sessions whose steps cost greedy_factor times as much
  double greedy_factor = 60;
  size_t crowd = 0;  // sessions that belong to one client; the others belong to another
  double seconds = 20;
};

struct Outcome {
  double ticks = 0, late = 0, steps = 0, degraded = 0, level_changes = 0;
  double modest_late = 0, modest_degraded = 0;  // of the sessions that are neither greedy nor of the crowd
};

struct Player : DeadlineQueue::Flow {
  Player(FairShares& shares, const BudgetRules& rules, const char* client) : quality(rules, shares, client) {}
  QualityControl quality;
  TickPace pace;
  int64_t next_tick_ns = 0;
  double cost_factor = 1.0, swing_phase = 0.0;
  bool greedy = false, busy = false;
  std::deque<int64_t> inbox, stepping;  // when each tick was due
  int64_t due_ns = 0, start_ns = 0, interval_ns = 1;
  int level = 0;
  double left_ns = 0.0;  // work of the step that is under way
};

class Model {
 public:
  explicit Model(const Load& load) : load_(load), shares_(kSteppers * rules_.largest_share) {
    for (size_t i = 0; i < load.sessions; ++i) {
      auto& player = *players_.emplace_back(std::make_unique<Player>(shares_, rules_, i < load.crowd ? "crowd" : ""));
      if (i < load.crowd) queue_.join(player, "crowd");
      player.next_tick_ns = static_cast<int64_t>(i) * kIntervalNs / static_cast<int64_t>(load.sessions);
      player.greedy = i < std::max(load.greedy, load.crowd);
      player.cost_factor = random_.next_in(0.7, 1.3) * (i < load.greedy ? load.greedy_factor : 1.0);
      player.swing_phase = random_.next_in(0.0, 6.0);
    }
  }

  Outcome run() {
    for (; now_ns_ < static_cast<int64_t>(load_.seconds * 1e9); now_ns_ += kGrainNs) {
      for (const auto& player : players_) send_tick(*player);
      for (size_t thread = 0; thread < kThreads; ++thread)
        if (!ready_[thread] && has_work(thread)) ready_[thread] = true, waiting_.push_back(thread);
      for (Cpu& cpu : cpus_) {
        choose_thread(cpu);
        if (cpu.thread == kThreads) continue;
        cpu.slice_ns -= kGrainNs;
        work(cpu.thread);
      }
    }
    return outcome_;
  }

 private:
  struct Cpu {
    size_t thread = kThreads;  // none
    int64_t slice_ns = 0;
  };
  struct Transfer {
    Player* player;
    int64_t tick_ns;            // of a tick
    std::deque<int64_t> ticks;  // of a reply: the ticks that it answers; else empty
    double left_ns;
  };

  void send_tick(Player& player) {
    if (now_ns_ < player.next_tick_ns) return;
    client_ns_ += 500 * load_.transport_us;
    transfers_.push_back({&player, player.next_tick_ns, {}, 500 * load_.transport_us});
    player.next_tick_ns += kIntervalNs;
    ++outcome_.ticks;
  }

  bool has_work(size_t thread) const {
    if (thread < kSteppers) return stepping_[thread] || !queue_.empty();
    return thread == kLoop ? !transfers_.empty() : client_ns_ > 0;
  }
  void choose_thread(Cpu& cpu) {
    if (cpu.thread < kThreads && (!has_work(cpu.thread) || (cpu.slice_ns <= 0 && !waiting_.empty()))) {
      ready_[cpu.thread] = has_work(cpu.thread);
      if (ready_[cpu.thread]) waiting_.push_back(cpu.thread);
      cpu.thread = kThreads;
    }
    while (cpu.thread == kThreads && !waiting_.empty()) {
      const size_t next = waiting_.front();
      waiting_.pop_front();
      ready_[next] = has_work(next);
      if (ready_[next]) cpu = {next, kSliceNs};
    }
  }
  void work(size_t thread) {
    if (thread < kSteppers) return step(stepping_[thread]);
    if (thread == kClient) client_ns_ -= kGrainNs;
    if (thread == kLoop && (transfers_.front().left_ns -= kGrainNs) <= 0) transfer();
  }

  void transfer() {
    const Transfer done = std::move(transfers_.front());
    transfers_.pop_front();
    Player& player = *done.player;
    if (done.ticks.empty()) {
      player.pace.observe(now_ns_, {.dt_s = kIntervalNs * 1e-9});
      player.inbox.push_back(done.tick_ns);
      if (!player.busy) post(player);
      return;
    }
    client_ns_ += 500 * load_.transport_us;
    for (const int64_t tick_ns : done.ticks) {
      outcome_.late += now_ns_ - tick_ns > kIntervalNs;
      outcome_.modest_late += !player.greedy && now_ns_ - tick_ns > kIntervalNs;
    }
  }

  void post(Player& player) {
    player.busy = true;
    player.due_ns = std::max(player.pace.deadline_ns(), now_ns_ + 2'000'000);
    queue_.push(player, player.due_ns);
  }
  void step(Player*& player) {
    if (!player) {
      player = static_cast<Player*>(queue_.pop(now_ns_));
      if (!player) return;
      player->start_ns = now_ns_;
      player->stepping.swap(player->inbox);
      player->interval_ns = player->pace.interval_ns();
      player->level = player->quality.begin_step(std::nullopt);
      player->left_ns = cost_ns(*player);
    }
    if ((player->left_ns -= kGrainNs) <= 0) finish(*std::exchange(player, nullptr));
  }
  double cost_ns(const Player& player) {
    const double time_s = static_cast<double>(now_ns_) * 1e-9;
    double factor = time_s > 5 && time_s < 12 ? load_.hard_factor : 1.0;
    factor *= 1 + load_.swing * std::sin(2 * std::numbers::pi * time_s / 4 + player.swing_phase);
    return 1e3 * load_.step_us * player.cost_factor * factor * kRelativeCost[player.level] * random_.next_in(0.7, 1.3);
  }
  void finish(Player& player) {
    ++outcome_.steps;
    outcome_.degraded += player.level > 0;
    outcome_.modest_degraded += !player.greedy && player.level > 0;
    const int64_t cost_ns = now_ns_ + kGrainNs - player.start_ns;
    queue_.charge(player, cost_ns, now_ns_);
    player.busy = false;
    const int64_t due_ns = player.due_ns;
    const bool behind = !player.inbox.empty() || player.stepping.size() > 1;
    if (!player.inbox.empty()) post(player);
    transfers_.push_back({&player, 0, std::move(player.stepping), 500 * load_.transport_us});
    player.stepping.clear();
    outcome_.level_changes += player.quality
                                  .finish_step({.end_ns = now_ns_,
                                                .due_ns = due_ns,
                                                .cost_ns = cost_ns,
                                                .interval_ns = player.interval_ns,
                                                .behind = behind})
                                  .has_value();
  }

  const Load load_;
  const BudgetRules rules_;
  CounterRandom random_{1, 0, RandomPurpose::kTest};
  FairShares shares_;
  DeadlineQueue queue_{kSteppers};
  std::vector<std::unique_ptr<Player>> players_;
  Player* stepping_[kSteppers] = {};
  std::deque<Transfer> transfers_;  // for the event loop
  double client_ns_ = 0.0;          // work of the client
  Cpu cpus_[kCpus];
  std::deque<size_t> waiting_;  // threads that wait for a CPU
  bool ready_[kThreads] = {};   // threads that wait for a CPU or have one
  int64_t now_ns_ = 0;
  Outcome outcome_;
};

void print(const char* name, const Outcome& o) {
  std::printf("%-10s late %.2f %%, degraded %.1f %%, level changes %.0f, modest: late %.2f %%, degraded %.1f %%\n",
              name, 100 * o.late / o.ticks, 100 * o.degraded / o.steps, o.level_changes, 100 * o.modest_late / o.ticks,
              100 * o.modest_degraded / o.steps);
}

TEST(OverloadModel, ALoadThatFitsIsNeitherLateNorDegraded) {
  const Outcome outcome = Model({.sessions = 60, .seconds = 10}).run();
  print("fits", outcome);
  EXPECT_EQ(outcome.late, 0);
  EXPECT_EQ(outcome.degraded, 0);
}

// The steps alone fit the threads, but not with the transport on the same CPUs.
TEST(OverloadModel, LateStepsMakeSessionsLeaveTimeForTheTransport) {
  const Outcome outcome = Model({.step_us = 200}).run();
  print("steady", outcome);
  EXPECT_LT(outcome.late, 0.03 * outcome.ticks);
  EXPECT_LT(outcome.degraded, 0.5 * outcome.steps);
}

TEST(OverloadModel, AnOverloadOfSecondsIsMostlyAnsweredInTime) {
  const Outcome outcome = Model({.hard_factor = 3.5}).run();
  print("hard", outcome);
  EXPECT_LT(outcome.late, 0.025 * outcome.ticks);
  EXPECT_LT(outcome.degraded, 0.4 * outcome.steps);
}

TEST(OverloadModel, GreedySessionsDoNotTakeTimeFromModestOnes) {
  const Outcome outcome = Model({.sessions = 40, .step_us = 150, .greedy = 4}).run();
  print("greedy", outcome);
  EXPECT_LT(outcome.modest_late, 0.005 * outcome.ticks);
  EXPECT_EQ(outcome.modest_degraded, 0);
  EXPECT_GT(outcome.degraded, 0);
}

TEST(OverloadModel, ACrowdOfOneClientTakesNothingFromAnotherClient) {
  const Outcome outcome = Model({.sessions = 104, .step_us = 1500, .transport_us = 20, .crowd = 100}).run();
  print("crowd", outcome);
  EXPECT_LT(outcome.modest_late, 0.01 * outcome.ticks * 4 / 104);
  EXPECT_EQ(outcome.modest_degraded, 0);
  EXPECT_GT(outcome.degraded, 0);
}

TEST(OverloadModel, ACostThatSwingsDoesNotMakeTheLevelSwing) {
  const Outcome outcome = Model({.sessions = 20, .step_us = 1500, .swing = 0.4, .seconds = 40}).run();
  print("swinging", outcome);
  EXPECT_LT(outcome.level_changes, 20 * 40 * 0.02);
  EXPECT_LT(outcome.late, 0.01 * outcome.ticks);
}

}  // namespace
}  // namespace sightline
