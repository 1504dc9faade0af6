// The threads around the queue: rounds of one task and of several, and a sampler that fails.
#include "server/schedule/scheduler.h"

#include <gtest/gtest.h>

#include <atomic>
#include <condition_variable>
#include <stdexcept>

namespace sightline {
namespace {

constexpr std::chrono::seconds kTimeout{30};

// A sampler that takes no maps and records which jobs came in one batch.
class CountingDevice final : public SamplerDevice {
 public:
  explicit CountingDevice(size_t best_batch) : best_batch_(best_batch) {}

  std::unique_ptr<Sampler> make_sampler() override { return nullptr; }
  std::string kind() const override { return "none"; }
  std::string renderer() const override { return "none"; }
  size_t geometry_bytes() const override { return 0; }
  size_t best_batch() const override { return best_batch_; }
  void take_all(std::span<TakeJob> jobs) override {
    const std::lock_guard lock(mutex_);
    batches_.push_back(jobs.size());
    if (clock_) *clock_ += takes_ns_;
    if (throws_) throw std::runtime_error("thrown by a test");
    for (TakeJob& job : jobs)
      if (job.requests.size() == kFails) job.taken = fail(ErrorCode::kUnavailable, "", "asked for by a test");
  }

  std::vector<size_t> batches() const {
    const std::lock_guard lock(mutex_);
    return batches_;
  }
  void throw_always() { throws_ = true; }
  // Each batch lets this clock go on. Set before the first batch.
  void take_time(std::atomic<int64_t>& clock, int64_t ns) { clock_ = &clock, takes_ns_ = ns; }

  static constexpr size_t kFails = 7;  // a job with this many requests fails

 private:
  const size_t best_batch_;
  mutable std::mutex mutex_;
  std::vector<size_t> batches_;
  std::atomic<bool> throws_{false};
  std::atomic<int64_t>* clock_ = nullptr;
  int64_t takes_ns_ = 0;
};

// A log of events, in order.
class EventLog {
 public:
  void note(const std::string& entry) {
    const std::lock_guard lock(mutex_);
    entries_.push_back(entry);
    changed_.notify_all();
  }
  std::vector<std::string> after(size_t entries) {
    std::unique_lock lock(mutex_);
    EXPECT_TRUE(changed_.wait_for(lock, kTimeout, [&] { return entries_.size() >= entries; }));
    return entries_;
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<std::string> entries_;
};

// Asks for `requests` maps, and notes "<name> planned" and "<name> ok", "failed" or "thrown".
class Task : public Scheduled {
 public:
  Task(EventLog& events, std::string name, size_t requests)
      : events_(events), name_(std::move(name)), requests_(requests) {}

  TakeJob plan() override {
    events_.note(name_ + " planned");
    return {.requests = requests_, .taken = {}};
  }
  void finish(const TakenMaps& taken) override {
    events_.note(name_ + (taken.trouble ? " thrown" : taken.status ? " ok" : " failed"));
  }

 private:
  EventLog& events_;
  const std::string name_;
  const std::vector<MapRequest> requests_;
};

// Blocks a scheduler thread until released.
class Plug final : public Scheduled {
 public:
  TakeJob plan() override {
    std::unique_lock lock(mutex_);
    holds_ = true;
    changed_.notify_all();
    changed_.wait(lock, [this] { return pulled_; });
    return {};
  }
  void finish(const TakenMaps&) override {}
  void wait_until_it_holds() {
    std::unique_lock lock(mutex_);
    EXPECT_TRUE(changed_.wait_for(lock, kTimeout, [this] { return holds_; }));
  }
  void pull() {
    const std::lock_guard lock(mutex_);
    pulled_ = true;
    changed_.notify_all();
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  bool holds_ = false, pulled_ = false;
};

// One scheduler thread, which is blocked while tasks are posted.
struct HeldScheduler {
  explicit HeldScheduler(size_t best_batch, unsigned threads = 1)
      : device(best_batch), scheduler(threads, device, [this] { return static_cast<int64_t>(++ticks); }) {
    for (unsigned i = 0; i < threads; ++i) {
      plugs.push_back(std::make_shared<Plug>());
      scheduler.post(plugs.back(), 0);
      plugs.back()->wait_until_it_holds();
    }
  }
  void post(const std::string& name, size_t requests, int64_t deadline_ns) {
    scheduler.post(std::make_shared<Task>(events, name, requests), deadline_ns);
  }
  std::vector<std::string> run(size_t entries) {
    for (const auto& plug : plugs) plug->pull();
    return events.after(entries);
  }

  std::atomic<uint64_t> ticks{0};
  CountingDevice device;
  EventLog events;
  std::vector<std::shared_ptr<Plug>> plugs;
  Scheduler scheduler;
};

using Entries = std::vector<std::string>;
constexpr int64_t kLater = 1'000'000'000'000;  // no deadline is missed

TEST(Scheduler, OneAfterTheOtherWhereBatchesGainNothing) {
  HeldScheduler held(1);
  held.post("late", 2, kLater + 2), held.post("soon", 2, kLater + 1);
  EXPECT_EQ(held.run(4), (Entries{"soon planned", "soon ok", "late planned", "late ok"}));
  EXPECT_EQ(held.device.batches(), (std::vector<size_t>{1, 1}));
}

TEST(Scheduler, MapsOfAllThatWaitAreTakenTogetherUpToTheBestBatch) {
  HeldScheduler held(3);
  for (int i = 0; i < 5; ++i) held.post(std::to_string(i), 2, kLater + i);
  EXPECT_EQ(held.run(10), (Entries{"0 planned", "1 planned", "2 planned", "0 ok", "1 ok", "2 ok", "3 planned",
                                   "4 planned", "3 ok", "4 ok"}));
  EXPECT_EQ(held.device.batches(), (std::vector<size_t>{3, 2}));
}

TEST(Scheduler, AThreadLeavesTheOthersTheirPart) {
  HeldScheduler held(8, 2);
  for (int i = 0; i < 6; ++i) held.post(std::to_string(i), 1, kLater);
  held.run(12);
  for (const size_t batch : held.device.batches()) EXPECT_LE(batch, 3u);
}

TEST(Scheduler, ATaskWithoutMapsIsFinishedWithoutTheDevice) {
  HeldScheduler held(4);
  held.post("without", 0, kLater), held.post("with", 1, kLater + 1);
  EXPECT_EQ(held.run(4), (Entries{"without planned", "with planned", "without ok", "with ok"}));
  EXPECT_EQ(held.device.batches(), (std::vector<size_t>{1}));
}

TEST(Scheduler, EachTaskGetsTheResultOfItsOwnMaps) {
  HeldScheduler held(4);
  held.post("good", 1, kLater), held.post("bad", CountingDevice::kFails, kLater + 1), held.post("fine", 2, kLater + 2);
  const Entries entries = held.run(6);
  EXPECT_EQ(Entries(entries.begin() + 3, entries.end()), (Entries{"good ok", "bad failed", "fine ok"}));
}

TEST(Scheduler, AnExceptionOfTheDeviceReachesTheTasksThatAskedForMaps) {
  HeldScheduler held(4);
  held.device.throw_always();
  held.post("a", 1, kLater), held.post("without", 0, kLater + 1), held.post("b", 1, kLater + 2);
  const Entries entries = held.run(6);
  EXPECT_EQ(Entries(entries.begin() + 3, entries.end()), (Entries{"a thrown", "without ok", "b thrown"}));
  held.post("next", 0, kLater);  // and the thread goes on
  EXPECT_EQ(held.events.after(8).back(), "next ok");
}

// The plan of each task takes a time of its own, and the maps of all together take 80 ns.
TEST(Scheduler, TheTimeOfTheMapsIsDividedByTheirNumber) {
  class Priced final : public Task {
   public:
    Priced(EventLog& log, size_t requests, std::atomic<int64_t>& clock, int64_t plan_ns)
        : Task(log, std::to_string(requests), requests), clock_(clock), plan_ns_(plan_ns) {}
    TakeJob plan() override {
      clock_ += plan_ns_;
      return Task::plan();
    }
    void finish(const TakenMaps& taken) override {
      cost_ns = taken.cost_ns;
      clock_ += 1000;  // the time of its end is its own too, but is known only afterwards
      Task::finish(taken);
    }
    std::atomic<int64_t> cost_ns{-1};

   private:
    std::atomic<int64_t>& clock_;
    const int64_t plan_ns_;
  };
  std::atomic<int64_t> now_ns{0};
  CountingDevice device(4);
  device.take_time(now_ns, 80);
  EventLog events;
  Scheduler scheduler(1, device, [&] { return now_ns.load(); });
  const auto plug = std::make_shared<Plug>();
  scheduler.post(plug, 0);
  plug->wait_until_it_holds();
  const auto one = std::make_shared<Priced>(events, 1, now_ns, 5),
             none = std::make_shared<Priced>(events, 0, now_ns, 7),
             three = std::make_shared<Priced>(events, 3, now_ns, 11);
  scheduler.post(one, kLater), scheduler.post(none, kLater + 1), scheduler.post(three, kLater + 2);
  plug->pull();
  events.after(6);
  EXPECT_EQ(device.batches(), (std::vector<size_t>{2}));
  EXPECT_EQ(one->cost_ns, 5 + 20);
  EXPECT_EQ(none->cost_ns, 7);
  EXPECT_EQ(three->cost_ns, 11 + 60);
}

TEST(Scheduler, RunsAllWaitingTasksBeforeItEnds) {
  EventLog events;
  CountingDevice device(1);
  {
    Scheduler scheduler(2, device, [] { return int64_t{0}; });
    for (int i = 0; i < 50; ++i) scheduler.post(std::make_shared<Task>(events, "task", 1), i);
  }
  EXPECT_EQ(events.after(0).size(), 100u);
}

// Each look at this clock takes longer than a step may to be a short one. So all steps are long, and of those that wait
// some are held.
TEST(Scheduler, RunsTasksThatAreHeldBeforeItEnds) {
  EventLog events;
  CountingDevice device(1);
  std::atomic<int64_t> now_ns{0};
  {
    Scheduler scheduler(2, device, [&] { return now_ns += 2 * DeadlineQueue::kLongStepNs; });
    std::vector<std::shared_ptr<Task>> tasks;
    for (int i = 0; i < 8; ++i) {
      tasks.push_back(std::make_shared<Task>(events, "task", 1));
      scheduler.join(*tasks.back(), i < 6 ? "long" : "other");
    }
    for (size_t round = 1; round <= 5; ++round) {
      for (const auto& task : tasks) scheduler.post(task, kLater);
      if (round < 5) events.after(16 * round);
    }
  }
  EXPECT_EQ(events.after(0).size(), 5u * 16);
}

int64_t no_time() {
  return 0;
}

TEST(Scheduler, RunsOnTheCallersThreadOnlyWhereAThreadWouldBeFree) {
  CountingDevice device(1);
  Scheduler scheduler(1, device, no_time);
  EventLog events;
  Task free(events, "free", 1), late(events, "late", 1);
  EXPECT_TRUE(scheduler.try_run_now(free, 0));
  EXPECT_EQ(events.after(2), (std::vector<std::string>{"free planned", "free ok"}));
  const auto plug = std::make_shared<Plug>();
  scheduler.post(plug, 0);
  plug->wait_until_it_holds();
  EXPECT_FALSE(scheduler.try_run_now(late, 0));  // the one thread is taken
  EXPECT_EQ(events.after(2).size(), 2u);
  plug->pull();
}

TEST(Scheduler, ARoundOnTheCallersThreadCountsAsOneOfTheThreads) {
  CountingDevice device(1);
  Scheduler scheduler(1, device, no_time);
  EventLog events;
  Plug here;
  std::thread caller([&] { EXPECT_TRUE(scheduler.try_run_now(here, 0)); });
  here.wait_until_it_holds();
  scheduler.post(std::make_shared<Task>(events, "waiting", 1), 0);
  Task other(events, "other", 1);
  EXPECT_FALSE(scheduler.try_run_now(other, 0));  // a task waits, and the one thread is busy
  EXPECT_TRUE(events.after(0).empty());
  here.pull();
  caller.join();
  EXPECT_EQ(events.after(2), (std::vector<std::string>{"waiting planned", "waiting ok"}));
}

// A round on the caller's thread used to be compared with the deadline of an earlier round, which had long passed.
TEST(Scheduler, ARoundOnTheCallersThreadIsComparedWithItsOwnDeadline) {
  constexpr int64_t kMs = 1'000'000;
  std::atomic<int64_t> now_ns{0};
  CountingDevice device(1);
  EventLog events;
  class Costly final : public Task {
   public:
    Costly(EventLog& log, std::atomic<int64_t>& clock) : Task(log, "served", 0), now_ns(clock) {}
    TakeJob plan() override {
      now_ns += 5 * kMs;
      return Task::plan();
    }
    std::atomic<int64_t>& now_ns;
  };
  Scheduler scheduler(1, device, [&] { return now_ns.load(); });
  const auto served = std::make_shared<Costly>(events, now_ns);
  scheduler.post(served, 10 * kMs);
  Task idle(events, "idle", 0);
  while (!scheduler.try_run_now(idle, kLater)) std::this_thread::yield();  // the thread is free again
  now_ns = 50 * kMs;
  ASSERT_TRUE(scheduler.try_run_now(*served, 100 * kMs));
  const size_t before = events.after(0).size();

  const auto plug = std::make_shared<Plug>();
  scheduler.post(plug, kLater);
  plug->wait_until_it_holds();
  scheduler.post(served, kLater + 1);
  scheduler.post(std::make_shared<Task>(events, "fresh", 0), kLater + 2);
  plug->pull();
  const Entries entries = events.after(before + 4);
  // No deadline was missed, so tasks still run in the order of their deadlines.
  EXPECT_EQ(Entries(entries.begin() + static_cast<ptrdiff_t>(before), entries.end()),
            (Entries{"served planned", "served ok", "fresh planned", "fresh ok"}));
}

// A step that was short for its client says little of the next one, so a client may hold up the caller's thread only
// for a small part of the time.
TEST(Scheduler, AClientWithALongStepOnTheCallersThreadStepsElsewhereForAWhile) {
  constexpr int64_t kLong = DeadlineQueue::kLongStepNs + 1;
  std::atomic<int64_t> now_ns{0}, busy_ns{0};
  CountingDevice device(1);
  EventLog events;
  class Costly final : public Task {
   public:
    Costly(EventLog& log, std::atomic<int64_t>& busy, int64_t takes)
        : Task(log, "costly", 0), busy_(busy), takes_(takes) {}
    TakeJob plan() override {
      busy_ += takes_;
      return Task::plan();
    }

   private:
    std::atomic<int64_t>& busy_;
    const int64_t takes_;
  };
  Scheduler scheduler(
      1, device, [&] { return now_ns.load(); }, [&] { return busy_ns.load(); });
  Costly nearly(events, busy_ns, kLong - 1), costly(events, busy_ns, kLong);
  Task same(events, "same", 0), other(events, "other", 0);
  for (Scheduled* const task :
       {static_cast<Scheduled*>(&nearly), static_cast<Scheduled*>(&costly), static_cast<Scheduled*>(&same)})
    scheduler.join(*task, "client");
  scheduler.join(other, "other");
  EXPECT_TRUE(scheduler.try_run_now(nearly, kLater));
  EXPECT_TRUE(scheduler.try_run_now(costly, kLater));
  EXPECT_FALSE(scheduler.try_run_now(costly, kLater));
  EXPECT_FALSE(scheduler.try_run_now(same, kLater)) << "another session of the client";
  EXPECT_TRUE(scheduler.try_run_now(other, kLater));
  now_ns = DeadlineQueue::kApart * kLong;
  EXPECT_TRUE(scheduler.try_run_now(same, kLater));
}

TEST(Scheduler, NothingRunsOnTheCallersThreadWhereBatchesGain) {
  CountingDevice device(4);
  Scheduler scheduler(2, device, no_time);
  EventLog events;
  Task task(events, "task", 1);
  EXPECT_FALSE(scheduler.try_run_now(task, 0));
}

TEST(Scheduler, RunsATaskOnTheCallersThreadToo) {
  EventLog events;
  CountingDevice device(4);
  Scheduler scheduler(1, device, [] { return int64_t{0}; });
  Task task(events, "here", 1);
  scheduler.run_now(task);
  EXPECT_EQ(events.after(0), (Entries{"here planned", "here ok"}));
}

TEST(Scheduler, SaysHowLongTheOldestRoundHasBeenRunning) {
  CountingDevice device(1);
  EventLog events;
  std::atomic<int64_t> now_ns{1'000};
  Scheduler scheduler(2, device, [&] { return now_ns.load(); });
  EXPECT_EQ(scheduler.longest_running_ns(), 0);
  class Waiting final : public Task {
   public:
    Waiting(EventLog& log, const char* name, std::atomic<bool>& go_on) : Task(log, name, 0), go_on_(go_on) {}
    void finish(const TakenMaps& taken) override {
      go_on_.wait(false);
      Task::finish(taken);
    }

   private:
    std::atomic<bool>& go_on_;
  };
  std::atomic<bool> first_goes{false}, second_goes{false};
  const auto release = [](std::atomic<bool>& goes) {
    goes = true;
    goes.notify_all();
  };
  const auto until = [&](int64_t expected_ns) {
    for (int i = 0; i < 30'000 && scheduler.longest_running_ns() != expected_ns; ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    EXPECT_EQ(scheduler.longest_running_ns(), expected_ns);
  };
  scheduler.post(std::make_shared<Waiting>(events, "first", first_goes), 1);
  events.after(1);
  now_ns += 500;
  scheduler.post(std::make_shared<Waiting>(events, "second", second_goes), 1);
  events.after(2);
  now_ns += 40;
  EXPECT_EQ(scheduler.longest_running_ns(), 540);
  release(first_goes);
  until(40);
  release(second_goes);
  until(0);
}

}  // namespace
}  // namespace sightline
