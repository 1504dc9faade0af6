// Timers on the steady clock: which run, in which order, and on which thread.
#include "server/rpc/timers.h"

#include <gtest/gtest.h>

#include <chrono>
#include <functional>
#include <future>
#include <memory>
#include <optional>
#include <thread>
#include <vector>

namespace sightline {
namespace {

using std::chrono::milliseconds;

constexpr std::chrono::hours kNever{1};

// Runs after everything that is due.
void wait_until_idle(Timers& timers) {
  std::promise<void> ran;
  timers.start(milliseconds(0), [&] { ran.set_value(); });
  ran.get_future().wait();
}

TEST(Timers, RunInTheOrderOfTheirTimesWhateverTheOrderOfTheirStarts) {
  Timers timers;
  std::vector<int> ran;
  std::promise<void> last;
  timers.start(milliseconds(60), [&] {
    ran.push_back(3);
    last.set_value();
  });
  timers.start(milliseconds(20), [&] { ran.push_back(1); });
  timers.start(milliseconds(40), [&] { ran.push_back(2); });
  last.get_future().wait();
  EXPECT_EQ(ran, (std::vector<int>{1, 2, 3}));
}

TEST(Timers, RunOnAThreadOfTheirOwnAndNotBeforeTheirTime) {
  Timers timers;
  std::promise<std::thread::id> ran;
  const auto before = std::chrono::steady_clock::now();
  timers.start(milliseconds(30), [&] { ran.set_value(std::this_thread::get_id()); });
  EXPECT_NE(ran.get_future().get(), std::this_thread::get_id());
  EXPECT_GE(std::chrono::steady_clock::now() - before, milliseconds(30));
}

TEST(Timers, DoNotRunOnceTheyAreCancelled) {
  Timers timers;
  bool ran = false;
  const Timers::Timer first = timers.start(milliseconds(5), [&] { ran = true; }), second = timers.start(kNever, [] {});
  const bool cancelled = timers.cancel(first);
  EXPECT_TRUE(timers.cancel(second));
  EXPECT_FALSE(timers.cancel(second)) << "a second time";
  std::this_thread::sleep_for(milliseconds(20));
  wait_until_idle(timers);
  EXPECT_NE(ran, cancelled) << "unless it ran before it could be cancelled";
}

TEST(Timers, CannotBeCancelledOnceTheyRan) {
  Timers timers;
  std::promise<void> ran;
  const Timers::Timer timer = timers.start(milliseconds(0), [&] { ran.set_value(); });
  ran.get_future().wait();
  EXPECT_FALSE(timers.cancel(timer));
}

TEST(Timers, GiveUpWhatTheirActionsHoldWhenTheyRanOrWereCancelled) {
  Timers timers;
  const auto of_first = std::make_shared<int>(), of_second = std::make_shared<int>();
  timers.start(milliseconds(0), [of_first] {});
  const Timers::Timer second = timers.start(kNever, [of_second] {});
  wait_until_idle(timers);
  timers.cancel(second);
  EXPECT_EQ(of_first.use_count(), 1);
  EXPECT_EQ(of_second.use_count(), 1);
}

TEST(Timers, AnActionMayStartTheNextTimer) {
  Timers timers;
  std::promise<int> end;
  int left = 50;
  std::function<void()> again = [&] { --left > 0 ? (void)timers.start(milliseconds(0), again) : end.set_value(left); };
  timers.start(milliseconds(0), again);
  EXPECT_EQ(end.get_future().get(), 0);
}

TEST(Timers, SayForHowLongAnActionHasHeldThemUp) {
  Timers timers;
  EXPECT_EQ(timers.late(), Timers::Duration::zero());
  timers.start(kNever, [] {});
  EXPECT_EQ(timers.late(), Timers::Duration::zero());
  std::promise<void> held, let_go;
  timers.start(milliseconds(0), [&] {
    held.set_value();
    let_go.get_future().wait();
  });
  held.get_future().wait();
  std::this_thread::sleep_for(milliseconds(20));
  EXPECT_GE(timers.late(), milliseconds(20));
  let_go.set_value();
  wait_until_idle(timers);
  bool on_time = false;
  for (int i = 0; i < 10'000 && !on_time; ++i, std::this_thread::sleep_for(milliseconds(1)))
    on_time = timers.late() == Timers::Duration::zero();
  EXPECT_TRUE(on_time);
}

TEST(Timers, ThoseThatHaveNotRunNeverDo) {
  bool ran = false;
  std::optional<Timers> timers(std::in_place);
  timers->start(kNever, [&] { ran = true; });
  timers.reset();
  EXPECT_FALSE(ran);
}

}  // namespace
}  // namespace sightline
