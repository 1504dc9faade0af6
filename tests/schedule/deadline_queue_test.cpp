// Earliest deadline first while everything fits; equal shares when it does not.
#include "server/schedule/deadline_queue.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <deque>
#include <memory>
#include <optional>
#include <vector>

#include "server/base/random.h"

namespace sightline {
namespace {

using Flow = DeadlineQueue::Flow;
constexpr int64_t kMs = 1'000'000;
constexpr int64_t kLateNever = 0;  // "now" before every deadline

CounterRandom random_of(uint64_t seed) {
  return CounterRandom(seed, 0, RandomPurpose::kTest);
}

TEST(DeadlineQueue, TheEarliestDeadlineGoesFirst) {
  constexpr size_t kFlows = 200;
  CounterRandom random = random_of(1);
  DeadlineQueue queue;
  std::vector<Flow> flows(kFlows);
  std::vector<const Flow*> expected;
  std::vector<int64_t> deadlines;
  for (Flow& flow : flows) {
    deadlines.push_back(1 + random.next_below(50) * kMs);  // many equal ones
    queue.push(flow, deadlines.back());
    queue.charge(flow, random.next_below(100) * kMs, kLateNever);  // costs do not matter while no deadline is missed
    expected.push_back(&flow);
  }
  std::stable_sort(expected.begin(), expected.end(), [&](const Flow* a, const Flow* b) {
    return deadlines[static_cast<size_t>(a - flows.data())] < deadlines[static_cast<size_t>(b - flows.data())];
  });
  for (const Flow* flow : expected) EXPECT_EQ(queue.pop(kLateNever), flow);
  EXPECT_EQ(queue.pop(kLateNever), nullptr);
}

TEST(DeadlineQueue, AfterAMissedDeadlineTheLeastServedGoesFirst) {
  DeadlineQueue queue;
  Flow much, little, none;
  for (auto [flow, cost] : {std::pair(&much, 9 * kMs), std::pair(&little, 2 * kMs)}) {
    queue.push(*flow, 1);
    queue.pop(0);
    queue.charge(*flow, cost, 0);
  }
  queue.push(much, 10 * kMs), queue.push(none, 30 * kMs), queue.push(little, 20 * kMs);
  EXPECT_FALSE(queue.overloaded(11 * kMs));
  EXPECT_EQ(queue.pop(11 * kMs), &none);
  EXPECT_TRUE(queue.overloaded(11 * kMs));
  EXPECT_EQ(queue.pop(11 * kMs), &little);
  EXPECT_EQ(queue.pop(11 * kMs), &much);
}

TEST(DeadlineQueue, AfterAWhileTheDeadlinesAreTriedAgain) {
  DeadlineQueue queue;
  Flow served, fresh;
  queue.push(served, 10 * kMs);
  ASSERT_EQ(queue.pop(0), &served);
  queue.charge(served, 20 * kMs, 20 * kMs);  // done too late
  const int64_t until_ns = 20 * kMs + DeadlineQueue::kFairForNs;
  for (const int64_t now_ns : {until_ns - 1, until_ns}) {
    queue.push(served, now_ns + kMs), queue.push(fresh, now_ns + 2 * kMs);
    EXPECT_EQ(queue.overloaded(now_ns), now_ns < until_ns);
    EXPECT_EQ(queue.pop(now_ns), now_ns < until_ns ? &fresh : &served);
    queue.pop(now_ns);
  }
}

TEST(DeadlineQueue, ACostThatIsKnownLateStillCounts) {
  DeadlineQueue queue;
  Flow a, b;
  queue.push(a, 1);
  ASSERT_EQ(queue.pop(0), &a);
  queue.push(a, 1);  // a second task waits before the cost of the first is known
  queue.push(b, 2);
  queue.charge(a, 5 * kMs, 10);  // late
  EXPECT_EQ(queue.pop(10), &b);
  EXPECT_EQ(queue.pop(10), &a);
}

// --- clients

// Lets the flow be served so long.
void serve(DeadlineQueue& queue, Flow& flow, int64_t cost_ns) {
  queue.push(flow, 1);
  ASSERT_EQ(queue.pop(0), &flow);
  queue.charge(flow, cost_ns, 0);
}

TEST(DeadlineQueue, AfterAMissedDeadlineTheLeastServedClientGoesFirst) {
  DeadlineQueue queue;
  Flow first_of_many, second_of_many, of_one;
  queue.join(first_of_many, "many"), queue.join(second_of_many, "many"), queue.join(of_one, "one");
  serve(queue, first_of_many, 9 * kMs);
  serve(queue, of_one, 5 * kMs);
  // The second session was never served, but its client was.
  queue.push(second_of_many, 10 * kMs), queue.push(of_one, 30 * kMs);
  EXPECT_EQ(queue.pop(11 * kMs), &of_one);
  EXPECT_EQ(queue.pop(11 * kMs), &second_of_many);
}

TEST(DeadlineQueue, AClientThatIsInTimeKeepsTheOrderOfItsDeadlines) {
  DeadlineQueue queue;
  Flow late, served, fresh;
  queue.join(late, "late"), queue.join(served, "in time"), queue.join(fresh, "in time");
  serve(queue, served, 2 * kMs);
  queue.push(late, 10 * kMs), queue.push(served, 20 * kMs), queue.push(fresh, 30 * kMs);
  EXPECT_EQ(queue.pop(11 * kMs), &late) << "it was served least";
  queue.charge(late, 9 * kMs, 11 * kMs);
  EXPECT_EQ(queue.pop(11 * kMs), &served) << "the client missed no deadline";
  EXPECT_EQ(queue.pop(11 * kMs), &fresh);
}

TEST(DeadlineQueue, WhileNothingIsLateDeadlinesDecideBetweenClients) {
  DeadlineQueue queue;
  Flow served, fresh;
  queue.join(served, "a"), queue.join(fresh, "b");
  serve(queue, served, 50 * kMs);
  queue.push(served, 20 * kMs), queue.push(fresh, 30 * kMs);
  EXPECT_EQ(queue.pop(0), &served);
  EXPECT_EQ(queue.pop(0), &fresh);
}

constexpr int64_t kLong = 2 * DeadlineQueue::kLongStepNs;

// Two clients on two threads. The steps of three sessions of the first are known to be long.
struct LongSteps : testing::Test {
  LongSteps() {
    for (Flow& flow : of_long) {
      queue.join(flow, "long");
      serve(queue, flow, kLong);
    }
    queue.join(of_other, "other");
  }
  // The other client steps.
  void other_steps(int64_t now_ns) {
    queue.push(of_other, now_ns + kMs);
    ASSERT_EQ(queue.pop(now_ns), &of_other);
    queue.charge(of_other, kMs / 10, now_ns);
  }

  DeadlineQueue queue{2};
  std::array<Flow, 3> of_long;
  Flow of_other;
};

TEST_F(LongSteps, OneClientLeavesTheLastThreadToTheOthers) {
  other_steps(kMs);
  for (Flow& flow : of_long) queue.push(flow, kMs + 20 * kMs);
  EXPECT_EQ(queue.pop(2 * kMs), &of_long[0]);
  EXPECT_FALSE(queue.ready(2 * kMs));
  EXPECT_EQ(queue.pop(2 * kMs), nullptr) << "although two wait";
  other_steps(3 * kMs);
  queue.charge(of_long[0], kLong, 4 * kMs);
  EXPECT_TRUE(queue.ready(4 * kMs));
  EXPECT_EQ(queue.pop(4 * kMs), &of_long[1]);
  EXPECT_EQ(queue.pop(4 * kMs), nullptr);
}

TEST_F(LongSteps, AClientThatStepsAloneHasAllThreads) {
  for (Flow& flow : of_long) queue.push(flow, kMs + 20 * kMs);
  EXPECT_EQ(queue.pop(2 * kMs), &of_long[0]);
  EXPECT_EQ(queue.pop(2 * kMs), &of_long[1]);
}

TEST_F(LongSteps, ASilentClientHoldsNothingBack) {
  other_steps(kMs);
  for (Flow& flow : of_long) queue.push(flow, 20'000 * kMs);
  const int64_t later_ns = kMs + DeadlineQueue::kActiveForNs;
  EXPECT_EQ(queue.pop(later_ns - 1), &of_long[0]);
  EXPECT_EQ(queue.pop(later_ns - 1), nullptr);
  EXPECT_EQ(queue.pop(later_ns), &of_long[1]);
}

TEST_F(LongSteps, AreKnownBeforeTheyAreOver) {
  other_steps(kMs);
  queue.push(of_long[0], 20 * kMs);
  ASSERT_EQ(queue.pop(2 * kMs), &of_long[0]);
  queue.push(of_long[0], 20 * kMs);  // before its cost is known
  EXPECT_EQ(queue.pop(2 * kMs), nullptr);
  queue.charge(of_long[0], kLong, 3 * kMs);
  EXPECT_EQ(queue.pop(3 * kMs), &of_long[0]);
  queue.charge(of_long[0], kLong, 4 * kMs);
  queue.push(of_long[1], 20 * kMs);
  EXPECT_EQ(queue.pop(4 * kMs), &of_long[1]) << "none is counted twice";
}

TEST_F(LongSteps, AreRememberedWhenTheirClientOpensItsSessionsAnew) {
  {
    Flow gone;
    queue.join(gone, "comes again");
    serve(queue, gone, kLong);
  }
  std::array<Flow, 2> again;
  for (Flow& flow : again) queue.join(flow, "comes again");
  serve(queue, again[0], kMs);
  other_steps(kMs);
  for (Flow& flow : again) queue.push(flow, 20 * kMs);
  EXPECT_EQ(queue.pop(2 * kMs), &again[0]);
  EXPECT_EQ(queue.pop(2 * kMs), nullptr);
}

TEST_F(LongSteps, AreExpectedOfStepsThatMayBeLong) {
  std::array<Flow, 2> changed;
  for (Flow& flow : changed) queue.join(flow, "changed");
  serve(queue, changed[0], kMs);
  const auto first_leaves_a_thread = [&](bool first, bool second) {
    other_steps(kMs), other_steps(kMs);
    queue.push(changed[0], 20 * kMs, first), queue.push(changed[1], 20 * kMs, second);
    EXPECT_EQ(queue.pop(2 * kMs), &changed[0]);
    const bool leaves = queue.pop(2 * kMs) == nullptr;
    queue.charge(changed[0], kMs, 3 * kMs);
    if (leaves) {
      EXPECT_EQ(queue.pop(3 * kMs), &changed[1]);
    }
    queue.charge(changed[1], kMs, 3 * kMs);
    return leaves;
  };
  EXPECT_FALSE(first_leaves_a_thread(false, false));
  EXPECT_TRUE(first_leaves_a_thread(true, true));
  EXPECT_TRUE(first_leaves_a_thread(true, false));
  EXPECT_FALSE(first_leaves_a_thread(false, false)) << "they were short";
}

TEST_F(LongSteps, CountForATimeInProportion) {
  constexpr int64_t kVeryLong = DeadlineQueue::kLongForNs;
  const auto leaves_a_thread = [&](int64_t now_ns) {
    other_steps(now_ns);
    queue.push(of_long[0], now_ns + kMs), queue.push(of_long[1], now_ns + kMs);
    EXPECT_EQ(queue.pop(now_ns), &of_long[0]);
    const bool leaves = queue.pop(now_ns) == nullptr;
    queue.charge(of_long[0], kMs, now_ns);
    if (leaves) {
      EXPECT_EQ(queue.pop(now_ns), &of_long[1]);
    }
    queue.charge(of_long[1], kMs, now_ns);
    return leaves;
  };
  other_steps(0);
  queue.push(of_long[2], 1);
  ASSERT_EQ(queue.pop(0), &of_long[2]);
  queue.charge(of_long[2], kVeryLong, 0);
  EXPECT_TRUE(leaves_a_thread(DeadlineQueue::kLongTimes * kVeryLong - 1));
  EXPECT_FALSE(leaves_a_thread(DeadlineQueue::kLongTimes * kVeryLong));
}

TEST_F(LongSteps, AClientThatHeldUpAnotherThreadIsKeptApart) {
  EXPECT_FALSE(queue.apart(of_long[0], 0)) << "for long steps on threads of the scheduler";
  queue.note_elsewhere(of_long[0], DeadlineQueue::kLongStepNs, kMs);
  EXPECT_FALSE(queue.apart(of_long[0], kMs));
  queue.note_elsewhere(of_long[0], kLong, kMs);
  const int64_t end_ns = kMs + DeadlineQueue::kApart * kLong;
  EXPECT_TRUE(queue.apart(of_long[1], end_ns - 1));
  EXPECT_FALSE(queue.apart(of_long[1], end_ns));
  EXPECT_FALSE(queue.apart(of_other, kMs));
  EXPECT_FALSE(queue.apart(Flow(), kMs)) << "it has no client yet";
  queue.note_elsewhere(of_long[0], 2 * kLong, kMs);
  queue.note_elsewhere(of_long[0], kLong, 2 * kMs);
  EXPECT_TRUE(queue.apart(of_long[0], kMs + 2 * DeadlineQueue::kApart * kLong - 1)) << "the longest one counts";
}

TEST_F(LongSteps, AClientThatIsKeptApartComesBackAsTheSame) {
  {
    Flow gone;
    queue.join(gone, "comes again");
    serve(queue, gone, kMs);
    queue.note_elsewhere(gone, kLong, kMs);
  }
  const int64_t end_ns = kMs + DeadlineQueue::kApart * kLong;
  other_steps(end_ns - 1);
  Flow again;
  queue.join(again, "comes again");
  EXPECT_TRUE(queue.apart(again, end_ns - 1));
}

TEST_F(LongSteps, AShortOneBetweenThemChangesNothing) {
  serve(queue, of_long[1], kMs);
  other_steps(kMs);
  queue.push(of_long[0], 20 * kMs), queue.push(of_long[1], 20 * kMs);
  EXPECT_EQ(queue.pop(2 * kMs), &of_long[0]);
  EXPECT_EQ(queue.pop(2 * kMs), nullptr);
}

TEST_F(LongSteps, TwoClientsLeaveTheLastThreadToAThirdWithShortOnes) {
  Flow of_second;
  queue.join(of_second, "second");
  serve(queue, of_second, kLong);
  const auto both_step = [&](int64_t now_ns) {
    queue.push(of_long[0], now_ns + 20 * kMs), queue.push(of_second, now_ns + 20 * kMs);
    EXPECT_EQ(queue.pop(now_ns), &of_long[0]);
    return queue.pop(now_ns) == &of_second;
  };
  EXPECT_TRUE(both_step(0)) << "no third one steps";
  queue.charge(of_long[0], kLong, kMs), queue.charge(of_second, kLong, kMs);
  other_steps(kMs);  // its first step: it counts as a client with long ones until then
  other_steps(kMs);
  EXPECT_FALSE(both_step(2 * kMs));
  queue.push(of_other, 3 * kMs);
  EXPECT_EQ(queue.pop(2 * kMs), &of_other) << "although it came last";
  queue.charge(of_long[0], kLong, 3 * kMs);
  EXPECT_EQ(queue.pop(3 * kMs), &of_second);
}

TEST_F(LongSteps, AreExpectedOfANewClientAndForAWhileAfterTheLast) {
  for (const int64_t first_ns : {kMs, kLong}) {
    SCOPED_TRACE(first_ns);
    std::array<Flow, 2> fresh;
    for (Flow& flow : fresh) queue.join(flow, "new");
    const auto has_all_threads = [&](int64_t now_ns, int64_t cost_ns) {
      other_steps(now_ns);
      for (Flow& flow : fresh) queue.push(flow, now_ns + 20 * kMs);
      EXPECT_EQ(queue.pop(now_ns), &fresh[0]);
      const bool all = queue.pop(now_ns) == &fresh[1];
      queue.charge(fresh[0], cost_ns, now_ns);
      EXPECT_EQ(all || queue.pop(now_ns) == &fresh[1], true);
      queue.charge(fresh[1], kMs, now_ns);
      return all;
    };
    EXPECT_FALSE(has_all_threads(kMs, first_ns));
    const int64_t end_ns = kMs + std::max(DeadlineQueue::kLongForNs, DeadlineQueue::kLongTimes * first_ns);
    EXPECT_EQ(has_all_threads(end_ns - 1, kMs), first_ns != kLong);
    EXPECT_TRUE(has_all_threads(end_ns, kMs));
  }
}

TEST_F(LongSteps, CountAsLongUntilTheyAreDone) {
  other_steps(kMs), other_steps(kMs);
  for (Flow& flow : of_long) queue.push(flow, 20 * kMs);
  EXPECT_EQ(queue.pop(2 * kMs), &of_long[0]);
  const int64_t later_ns = 3 * kMs + DeadlineQueue::kLongForNs;  // it still runs
  other_steps(later_ns);
  EXPECT_EQ(queue.pop(later_ns), nullptr);
}

TEST_F(LongSteps, AreNotHeldAtTheEnd) {
  other_steps(kMs);
  for (Flow& flow : of_long) queue.push(flow, 20 * kMs);
  queue.hold_none();
  for (Flow& flow : of_long) EXPECT_EQ(queue.pop(2 * kMs), &flow);
}

// --- a machine that steps

enum class Policy { kQueue, kFirstCome };

struct Player {
  int64_t interval_ns, cost_ns, phase_ns;
  const char* client = "";
  // Results:
  uint64_t steps = 0, late = 0;
  int64_t used_ns = 0, longest_wait_ns = 0;

  Flow flow{};
  std::optional<int64_t> newest_ns{};  // arrival of a tick that waits; newest wins
  int64_t due_ns = 0;                  // deadline of the oldest tick that waits
  bool running = false;
};

// Ticks arrive at fixed intervals. Each player is stepped by at most one of the threads at a time.
class Machine {
 public:
  Machine(std::vector<Player>& players, unsigned threads, Policy policy = Policy::kQueue)
      : players_(players), free_at_ns_(threads, 0), running_(threads, nullptr), policy_(policy), queue_(threads) {
    for (Player& player : players_) queue_.join(player.flow, player.client);
  }

  void run(int64_t until_ns) {
    constexpr int64_t kGrainNs = 10'000;
    for (; now_ns_ < until_ns; now_ns_ += kGrainNs) {
      for (Player& player : players_) arrive(player, kGrainNs);
      for (size_t thread = 0; thread < running_.size(); ++thread) {
        if (now_ns_ < free_at_ns_[thread]) continue;
        if (running_[thread]) finish(*std::exchange(running_[thread], nullptr));
        start(thread);
      }
    }
  }

 private:
  void arrive(Player& player, int64_t grain_ns) {
    const int64_t since_ns = now_ns_ - player.phase_ns;
    if (since_ns < 0 || since_ns % player.interval_ns >= grain_ns) return;
    player.newest_ns = now_ns_;
    if (!player.running && !waits(player)) post(player);
  }
  bool waits(const Player& player) const {
    return player.flow.waits() || std::find(first_come_.begin(), first_come_.end(), &player) != first_come_.end();
  }
  void post(Player& player) {
    player.due_ns = *player.newest_ns + player.interval_ns;
    if (policy_ == Policy::kFirstCome) return first_come_.push_back(&player);
    queue_.push(player.flow, player.due_ns);
  }
  Player* next() {
    if (policy_ == Policy::kQueue) {
      const Flow* flow = queue_.pop(now_ns_);
      for (Player& player : players_)
        if (&player.flow == flow) return &player;
      return nullptr;
    }
    if (first_come_.empty()) return nullptr;
    Player* player = first_come_.front();
    first_come_.pop_front();
    return player;
  }
  void start(size_t thread) {
    Player* player = next();
    if (!player) return;
    running_[thread] = player;
    player->running = true;
    player->longest_wait_ns = std::max(player->longest_wait_ns, now_ns_ - *player->newest_ns);
    player->late += now_ns_ + player->cost_ns > player->due_ns;
    player->newest_ns.reset();
    free_at_ns_[thread] = now_ns_ + player->cost_ns;
  }
  void finish(Player& player) {
    player.running = false;
    ++player.steps;
    player.used_ns += player.cost_ns;
    queue_.charge(player.flow, player.cost_ns, now_ns_);
    if (player.newest_ns) post(player);
  }

  std::vector<Player>& players_;
  std::vector<int64_t> free_at_ns_;
  std::vector<Player*> running_;
  const Policy policy_;
  DeadlineQueue queue_;
  std::deque<Player*> first_come_;
  int64_t now_ns_ = 0;
};

// Load of nine tenths of one thread: 24 games at 30 Hz that all tick at once, and one game at 500 Hz.
std::vector<Player> what_just_fits() {
  std::vector<Player> players;
  for (int i = 0; i < 24; ++i) players.push_back({33 * kMs, kMs, 0});
  players.push_back({2 * kMs, kMs / 5, 0});
  return players;
}

TEST(DeadlineQueue, NoDeadlineIsMissedWhileEverythingFits) {
  std::vector<Player> players = what_just_fits(), first_come = what_just_fits();
  Machine(players, 1).run(2000 * kMs);
  for (const Player& player : players) EXPECT_EQ(player.late, 0u);
  // The order matters: first come, first served misses deadlines in the same load.
  Machine(first_come, 1, Policy::kFirstCome).run(2000 * kMs);
  EXPECT_GT(first_come.back().late, 0u);
}

class Overload : public testing::TestWithParam<unsigned> {};

TEST_P(Overload, EqualSessionsGetEqualSharesOfThreeTimesTooMuch) {
  const unsigned threads = GetParam();
  CounterRandom random = random_of(threads);
  std::vector<Player> players;
  for (unsigned i = 0; i < 12 * threads; ++i) players.push_back({16 * kMs, 4 * kMs, random.next_below(16) * kMs});
  Machine(players, threads).run(4000 * kMs);
  const double equal_ns = 4000.0 * kMs / 12;
  for (const Player& player : players) {
    EXPECT_NEAR(static_cast<double>(player.used_ns), equal_ns, 0.1 * equal_ns);
    EXPECT_LT(player.longest_wait_ns, 2 * 12 * 4 * kMs);
  }
}

// If deadlines alone decided, the session with the highest tick rate would always be the most urgent.
TEST_P(Overload, AGreedySessionTakesNothingFromThoseThatAskForLittle) {
  const unsigned threads = GetParam();
  std::vector<Player> players;
  for (unsigned i = 0; i < threads; ++i) players.push_back({kMs, 5 * kMs, 0});  // five times a thread each
  for (unsigned i = 0; i < 5 * threads; ++i) players.push_back({16 * kMs, kMs, (3 * i % 16) * kMs});
  Machine(players, threads).run(4000 * kMs);
  for (size_t i = 0; i < players.size(); ++i) {
    EXPECT_GT(players[i].steps, 0u);
    if (i < threads) continue;
    EXPECT_GE(players[i].steps, 4000u / 16 * 97 / 100) << i;
  }
}

TEST_P(Overload, HugeStepsDelayTheOthersByOneOfThemAndNoMore) {
  const unsigned threads = GetParam();
  std::vector<Player> players;
  for (unsigned i = 0; i < 2 * threads; ++i) players.push_back({16 * kMs, 50 * kMs, 0});
  for (unsigned i = 0; i < 8; ++i) players.push_back({16 * kMs, kMs / 5, i * kMs});
  Machine(players, threads).run(4000 * kMs);
  for (size_t i = 0; i < players.size(); ++i) {
    if (i < 2 * threads)
      EXPECT_GT(players[i].steps, 30u) << i;  // of the 40 that fit
    else
      EXPECT_GE(players[i].steps, 4000u / 52 - 2) << i;
  }
}

TEST_P(Overload, ManySessionsOfOneClientTakeNothingFromAnother) {
  const unsigned threads = GetParam();
  std::vector<Player> players;
  for (unsigned i = 0; i < 150; ++i) players.push_back({kMs, 2 * kMs, 0, "many"});
  for (unsigned i = 0; i < 3; ++i) players.push_back({16 * kMs, kMs, 5 * i * kMs, "few"});
  Machine(players, threads).run(4000 * kMs);
  for (size_t i = 0; i < players.size(); ++i) {
    EXPECT_GT(players[i].steps, 0u) << i;
    if (i < 150) continue;
    EXPECT_GE(players[i].steps, 4000u / 16 - 1) << i;
    EXPECT_LE(players[i].longest_wait_ns, 4 * kMs) << "one step of the others, and two of its own client";
  }
}

TEST_P(Overload, LongStepsOfOtherClientsMakeNobodyWait) {
  const unsigned threads = GetParam();
  if (threads == 1) GTEST_SKIP() << "one thread is busy with a step that is not interrupted";
  std::vector<Player> players;
  for (const char* client : {"first", "first", "first", "second", "second", "third"})
    players.push_back({16 * kMs, 80 * kMs, 0, client});
  players.push_back({16 * kMs, kMs, 5 * kMs, "short"});
  Machine(players, threads).run(4000 * kMs);
  EXPECT_LE(players.back().late, 3u) << "until it is known that the steps are long";
  EXPECT_GE(players.back().steps, 4000u / 16 - 20);
  uint64_t long_steps = 0;
  for (unsigned i = 0; i < 6; ++i) long_steps += players[i].steps;
  EXPECT_GE(long_steps, (threads - 1) * 45u) << "of 50 for each thread";
}

TEST_P(Overload, ClientsGetEqualSharesWhateverTheNumberOfTheirSessions) {
  const unsigned threads = GetParam();
  std::vector<Player> players;
  for (unsigned i = 0; i < 40 * threads; ++i) players.push_back({16 * kMs, 4 * kMs, 0, "many"});
  for (unsigned i = 0; i < 8 * threads; ++i) players.push_back({16 * kMs, 4 * kMs, 0, "few"});
  Machine(players, threads).run(4000 * kMs);
  int64_t many_ns = 0;
  for (unsigned i = 0; i < 40 * threads; ++i) many_ns += players[i].used_ns;
  EXPECT_NEAR(static_cast<double>(many_ns), 2000.0 * kMs * threads, 40.0 * kMs * threads);
}

INSTANTIATE_TEST_SUITE_P(Threads, Overload, testing::Values(1u, 2u, 4u));

TEST(DeadlineQueue, ASilentSessionSavesUpNoClaim) {
  std::vector<Player> players;
  for (int i = 0; i < 3; ++i) players.push_back({4 * kMs, 4 * kMs, 0});
  players.push_back({4 * kMs, 4 * kMs, 2000 * kMs});  // silent for two seconds
  Machine(players, 1).run(4000 * kMs);
  // A quarter of the time from then on, and the once-only credit for its silence.
  constexpr double kClaim = DeadlineQueue::kClaimNs;
  EXPECT_NEAR(static_cast<double>(players[3].used_ns), (2000.0 * kMs - kClaim) / 4 + kClaim, 20.0 * kMs);
}

}  // namespace
}  // namespace sightline
