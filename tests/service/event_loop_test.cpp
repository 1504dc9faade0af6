// The event loop: what it runs itself, what it hands over, and how it ends. Its events are alarms; no call is made. The
// loop's clock is the test's, so that it does not matter how busy the machine is.
#include "server/rpc/event_loop.h"

#include <grpcpp/alarm.h>
#include <grpcpp/server.h>
#include <grpcpp/server_builder.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <functional>
#include <future>
#include <numeric>
#include <optional>
#include <thread>
#include <vector>

namespace sightline {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::steady_clock;
using std::chrono::system_clock;

// Stands still, except that each look moves it on by `per_look`. For any thread.
class TestClock {
 public:
  steady_clock::time_point now() { return steady_clock::time_point(microseconds(us_ += per_look_us_)); }
  void advance(microseconds by) { us_ += by.count(); }
  void set_per_look(microseconds by) { per_look_us_ = by.count(); }

 private:
  std::atomic<int64_t> us_{0}, per_look_us_{0};
};

// When the clock moves on by this with each look, every rest is a long one, and a task that runs at once is not late.
constexpr microseconds kLongRestPerLook{150};
// Longer than a loop may be busy.
constexpr milliseconds kTooLong{5};

// A loop needs a queue, and a queue needs a server. This server has no address.
class EventLoopTest : public testing::Test {
 protected:
  EventLoopTest() {
    grpc::ServerBuilder builder;
    std::unique_ptr<grpc::ServerCompletionQueue> queue = builder.AddCompletionQueue();
    server_ = builder.BuildAndStart();
    loop_ = std::make_unique<EventLoop>(std::move(queue), [this] { return clock_.now(); });
  }
  ~EventLoopTest() override { stop(); }
  void stop() {
    if (loop_) server_->Shutdown();
    loop_.reset();
  }
  EventLoop& loop() { return *loop_; }
  TestClock& clock() { return clock_; }

 private:
  TestClock clock_;
  std::unique_ptr<grpc::Server> server_;
  std::unique_ptr<EventLoop> loop_;
};

// Runs a function on a loop's thread, once. gRPC may swap alarms that are due in the same millisecond.
class Once final : public Event {
 public:
  Once(EventLoop& loop, std::function<void()> what, milliseconds after = milliseconds(0)) : what_(std::move(what)) {
    alarm_.Set(&loop.queue(), system_clock::now() + after, this);
  }
  void ready(bool) override {
    what_();
    done_.set_value();
  }
  void wait() { done_.get_future().wait(); }

 private:
  const std::function<void()> what_;
  std::promise<void> done_;
  grpc::Alarm alarm_;
};

struct Noted {
  std::vector<int> on_loop, handed_over;
  std::thread::id thread;
};

class NotedTask final : public ShortTask {
 public:
  NotedTask(int number, Noted& noted) : number_(number), noted_(noted) {}
  void run_on_loop() override {
    noted_.on_loop.push_back(number_);
    noted_.thread = std::this_thread::get_id();
  }
  void hand_over() override { noted_.handed_over.push_back(number_); }

 private:
  const int number_;
  Noted& noted_;
};

std::vector<int> numbers(size_t below) {
  std::vector<int> all(below);
  std::iota(all.begin(), all.end(), 0);
  return all;
}

TEST_F(EventLoopTest, RunsAShortTaskOnceTheEventIsOver) {
  constexpr int kTries = 200;
  Noted noted;
  std::thread::id loops_thread;
  for (int i = 0; i < kTries; ++i) {
    bool during = true;
    Once once(loop(), [&] {
      const size_t before = noted.on_loop.size();
      loop().defer(std::make_shared<NotedTask>(i, noted));
      loops_thread = std::this_thread::get_id();
      during = noted.on_loop.size() != before;
    });
    once.wait();
    EXPECT_FALSE(during);
  }
  stop();
  EXPECT_EQ(noted.on_loop, numbers(kTries));
  EXPECT_EQ(noted.thread, loops_thread);
  EXPECT_TRUE(noted.handed_over.empty());
}

TEST_F(EventLoopTest, HandsOverTheOldestWhileMoreComes) {
  constexpr int kMany = 50;
  Noted noted;
  std::vector<int> meanwhile;
  Once once(loop(), [&] {
    for (int i = 0; i < kMany; ++i) loop().defer(std::make_shared<NotedTask>(i, noted));
    meanwhile = noted.handed_over;
  });
  once.wait();
  stop();
  ASSERT_FALSE(meanwhile.empty());
  ASSERT_LT(meanwhile.size(), size_t{kMany});
  EXPECT_EQ(meanwhile, numbers(meanwhile.size()));
  EXPECT_EQ(noted.handed_over, meanwhile);
  std::vector<int> all = noted.handed_over;
  all.insert(all.end(), noted.on_loop.begin(), noted.on_loop.end());
  EXPECT_EQ(all, numbers(kMany));
}

// Otherwise a thread that never rests would take all steps by itself while other cores are idle.
TEST_F(EventLoopTest, HandsOverEverythingWhenItHasNotRestedForAWhile) {
  Noted noted;
  Once once(loop(), [&] {
    clock().advance(kTooLong);
    loop().defer(std::make_shared<NotedTask>(1, noted));
    loop().defer(std::make_shared<NotedTask>(2, noted));
  });
  once.wait();
  stop();
  EXPECT_EQ(noted.handed_over, (std::vector<int>{1, 2}));
  EXPECT_TRUE(noted.on_loop.empty());
}

// Two events are ready, and the first defers a task. Returns how much of that task is done when the second event is
// handled; nothing when the events came in the other order.
std::optional<size_t> done_before_the_second(EventLoop& loop, bool after_a_rest) {
  Noted noted;
  std::promise<void> both_ready;
  const auto wait = [&] { both_ready.get_future().wait(); };
  bool asked = false;
  std::optional<size_t> done_before;
  std::optional<Once> before;
  if (!after_a_rest) before.emplace(loop, wait);
  const auto ask = [&] {
    loop.defer(std::make_shared<NotedTask>(1, noted));
    asked = true;
    if (after_a_rest) wait();
  };
  Once first(loop, ask, milliseconds(5));
  const auto look = [&] {
    if (asked) done_before = noted.on_loop.size() + noted.handed_over.size();
  };
  Once second(loop, look, milliseconds(10));
  // All alarms have gone off before the reaction that waits ends.
  std::this_thread::sleep_for(milliseconds(30));
  both_ready.set_value();
  second.wait();
  // The loop runs deferred tasks before it rests, and so before this event.
  Once(
      loop, [] {}, milliseconds(20))
      .wait();
  EXPECT_EQ(noted.on_loop.size() + noted.handed_over.size(), 1u);
  return done_before;
}

// Ready events go before deferred tasks. An attempt fails when the events come in the other order.
TEST_F(EventLoopTest, ReadsBeforeItRunsDeferredTasks) {
  bool read_on = false;
  for (int i = 0; i < 20 && !read_on; ++i) read_on = done_before_the_second(loop(), false) == size_t{0};
  EXPECT_TRUE(read_on);
}

// Usually no other event is ready then. An attempt fails when the events come in the other order.
TEST_F(EventLoopTest, RunsTheFirstTaskAfterALongRestAtOnce) {
  clock().set_per_look(kLongRestPerLook);
  bool worked = false;
  for (int i = 0; i < 20 && !worked; ++i) worked = done_before_the_second(loop(), true) == size_t{1};
  EXPECT_TRUE(worked);
}

// The first of three events that are ready defers two tasks. Returns how many of them are done when the third event is
// handled; nothing when the events came in another order.
std::optional<size_t> done_before_the_third(EventLoop& loop) {
  Noted noted;
  std::promise<void> all_ready;
  int events = 0;
  std::optional<size_t> done_before;
  const auto ask = [&] {
    loop.defer(std::make_shared<NotedTask>(1, noted));
    loop.defer(std::make_shared<NotedTask>(2, noted));
    all_ready.get_future().wait();
    events = 1;
  };
  Once first(loop, ask, milliseconds(5));
  Once second(
      loop, [&] { events = events == 1 ? 2 : 0; }, milliseconds(10));
  const auto look = [&] {
    if (events == 2) done_before = noted.on_loop.size() + noted.handed_over.size();
  };
  Once third(loop, look, milliseconds(15));
  std::this_thread::sleep_for(milliseconds(30));
  all_ready.set_value();
  second.wait();
  third.wait();
  Once(
      loop, [] {}, milliseconds(20))
      .wait();
  EXPECT_EQ(noted.on_loop.size() + noted.handed_over.size(), 2u);
  return done_before;
}

// The first task runs at once, as above.
TEST_F(EventLoopTest, LaterEventsAreReadBeforeMoreTasksRun) {
  clock().set_per_look(kLongRestPerLook);
  bool one_only = false;
  for (int i = 0; i < 20 && !one_only; ++i) one_only = done_before_the_third(loop()) == size_t{1};
  EXPECT_TRUE(one_only);
}

// After a rest, the loop is no longer late, whatever held it up before.
TEST_F(EventLoopTest, TakesTasksAgainAfterARest) {
  Noted noted;
  Once(loop(), [&] {
    clock().advance(kTooLong);
    clock().set_per_look(kLongRestPerLook);
  }).wait();
  Once(loop(), [&] { loop().defer(std::make_shared<NotedTask>(1, noted)); }).wait();
  stop();
  EXPECT_EQ(noted.on_loop, std::vector<int>{1});
}

TEST_F(EventLoopTest, SaysForHowLongItHasNotAnswered) {
  using Duration = steady_clock::duration;
  std::promise<void> held, released;
  Once holds(loop(), [&] {
    held.set_value();
    released.get_future().wait();
  });
  held.get_future().wait();
  EXPECT_EQ(loop().silence().lasted, Duration::zero()) << "it is asked only now";
  clock().advance(milliseconds(5));
  EXPECT_EQ(loop().silence().lasted, milliseconds(5));
  clock().advance(milliseconds(2));
  EXPECT_EQ(loop().silence().lasted, milliseconds(7));
  released.set_value();
  holds.wait();
  bool answers = false;
  for (int i = 0; i < 10'000 && !answers; ++i, std::this_thread::sleep_for(milliseconds(1)))
    answers = loop().silence().lasted == Duration::zero();
  EXPECT_TRUE(answers) << "and is asked anew";
}

// What the thread does until it is let go tells a busy loop from one that hangs.
EventLoop::Silence silence_of_a_loop_that(EventLoop& loop,
                                          const std::function<void(const std::atomic<bool>& let_go)>& does) {
  std::promise<void> held;
  std::atomic<bool> let_go{false};
  Once holds(loop, [&] {
    held.set_value();
    does(let_go);
  });
  held.get_future().wait();
  loop.silence();
  std::this_thread::sleep_for(milliseconds(300));
  const EventLoop::Silence silence = loop.silence();
  let_go = true;
  let_go.notify_all();
  holds.wait();
  return silence;
}

TEST_F(EventLoopTest, SaysForHowLongItWasBusyMeanwhile) {
  const auto works = silence_of_a_loop_that(loop(), [](const auto& let_go) {
    while (!let_go) {
    }
  });
  EXPECT_GT(works.busy, milliseconds(200));
  const auto waits = silence_of_a_loop_that(loop(), [](const auto& let_go) { let_go.wait(false); });
  EXPECT_LT(waits.busy, milliseconds(100));
}

TEST_F(EventLoopTest, EndsOnlyAfterTheLastCall) {
  EventLoop& ending = loop();
  ending.call_begins();
  std::atomic<bool> ended{false};
  Once event(
      ending, [] {}, milliseconds(50));
  std::thread call([&] {
    event.wait();  // events are delivered until the end
    std::this_thread::sleep_for(milliseconds(50));
    ended = true;
    ending.call_ends();
  });
  stop();
  EXPECT_TRUE(ended);
  call.join();
}

}  // namespace
}  // namespace sightline
