// The threads round the queue: rounds of one and of many, and what becomes of a sampler that fails.
#include "server/schedule/scheduler.h"

#include <gtest/gtest.h>

#include <atomic>
#include <condition_variable>
#include <stdexcept>

namespace sightline {
namespace {

constexpr std::chrono::seconds kPatience{30};

// Takes nothing, and remembers which jobs came together.
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
    if (throws_) throw std::runtime_error("thrown by a test");
    for (TakeJob& job : jobs)
      if (job.requests.size() == kFails) job.taken = fail(ErrorCode::kUnavailable, "", "asked for by a test");
  }

  std::vector<size_t> batches() const {
    const std::lock_guard lock(mutex_);
    return batches_;
  }
  void throw_always() { throws_ = true; }

  static constexpr size_t kFails = 7;  // so many requests

 private:
  const size_t best_batch_;
  mutable std::mutex mutex_;
  std::vector<size_t> batches_;
  std::atomic<bool> throws_{false};
};

// What happened, in order.
class Diary {
 public:
  void note(const std::string& entry) {
    const std::lock_guard lock(mutex_);
    entries_.push_back(entry);
    changed_.notify_all();
  }
  std::vector<std::string> after(size_t entries) {
    std::unique_lock lock(mutex_);
    EXPECT_TRUE(changed_.wait_for(lock, kPatience, [&] { return entries_.size() >= entries; }));
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
  Task(Diary& diary, std::string name, size_t requests)
      : diary_(diary), name_(std::move(name)), requests_(requests) {}

  TakeJob plan() override {
    diary_.note(name_ + " planned");
    return {.requests = requests_, .taken = {}};
  }
  void finish(const TakenMaps& taken) override {
    diary_.note(name_ + (taken.trouble ? " thrown" : taken.status ? " ok" : " failed"));
  }

 private:
  Diary& diary_;
  const std::string name_;
  const std::vector<MapRequest> requests_;
};

// Holds a thread of the scheduler until it is told.
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
    EXPECT_TRUE(changed_.wait_for(lock, kPatience, [this] { return holds_; }));
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

// One thread, held while tasks are posted.
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
    scheduler.post(std::make_shared<Task>(diary, name, requests), deadline_ns);
  }
  std::vector<std::string> run(size_t entries) {
    for (const auto& plug : plugs) plug->pull();
    return diary.after(entries);
  }

  std::atomic<uint64_t> ticks{0};
  CountingDevice device;
  Diary diary;
  std::vector<std::shared_ptr<Plug>> plugs;
  Scheduler scheduler;
};

using Entries = std::vector<std::string>;
constexpr int64_t kLater = 1'000'000'000'000;  // nobody is late

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

TEST(Scheduler, WhoNeedsNoMapsIsFinishedWithoutTheDevice) {
  HeldScheduler held(4);
  held.post("without", 0, kLater), held.post("with", 1, kLater + 1);
  EXPECT_EQ(held.run(4), (Entries{"without planned", "with planned", "without ok", "with ok"}));
  EXPECT_EQ(held.device.batches(), (std::vector<size_t>{1}));
}

TEST(Scheduler, EachLearnsWhatBecameOfItsOwnMaps) {
  HeldScheduler held(4);
  held.post("good", 1, kLater), held.post("bad", CountingDevice::kFails, kLater + 1),
      held.post("fine", 2, kLater + 2);
  const Entries entries = held.run(6);
  EXPECT_EQ(Entries(entries.begin() + 3, entries.end()), (Entries{"good ok", "bad failed", "fine ok"}));
}

TEST(Scheduler, WhatTheDeviceThrowsIsForThoseWhoAskedForMaps) {
  HeldScheduler held(4);
  held.device.throw_always();
  held.post("a", 1, kLater), held.post("without", 0, kLater + 1), held.post("b", 1, kLater + 2);
  const Entries entries = held.run(6);
  EXPECT_EQ(Entries(entries.begin() + 3, entries.end()), (Entries{"a thrown", "without ok", "b thrown"}));
  held.post("next", 0, kLater);  // and the thread goes on
  EXPECT_EQ(held.diary.after(8).back(), "next ok");
}

TEST(Scheduler, RunsWhatWaitsBeforeItEnds) {
  Diary diary;
  CountingDevice device(1);
  {
    Scheduler scheduler(2, device, [] { return int64_t{0}; });
    for (int i = 0; i < 50; ++i) scheduler.post(std::make_shared<Task>(diary, "task", 1), i);
  }
  EXPECT_EQ(diary.after(0).size(), 100u);
}

int64_t no_time() {
  return 0;
}

TEST(Scheduler, StepsHereOnlyWhereAThreadWouldBeFree) {
  CountingDevice device(1);
  Scheduler scheduler(1, device, no_time);
  Diary diary;
  Task free(diary, "free", 1), late(diary, "late", 1);
  EXPECT_TRUE(scheduler.try_here(free));
  EXPECT_EQ(diary.after(2), (std::vector<std::string>{"free planned", "free ok"}));
  const auto plug = std::make_shared<Plug>();
  scheduler.post(plug, 0);
  plug->wait_until_it_holds();
  EXPECT_FALSE(scheduler.try_here(late));  // the one thread is taken
  EXPECT_EQ(diary.after(2).size(), 2u);
  plug->pull();
}

TEST(Scheduler, WhatStepsHereTakesTheTurnOfAThread) {
  CountingDevice device(1);
  Scheduler scheduler(1, device, no_time);
  Diary diary;
  Plug here;
  std::thread caller([&] { EXPECT_TRUE(scheduler.try_here(here)); });
  here.wait_until_it_holds();
  scheduler.post(std::make_shared<Task>(diary, "waiting", 1), 0);
  Task other(diary, "other", 1);
  EXPECT_FALSE(scheduler.try_here(other));  // somebody waits, and the turn is taken
  EXPECT_TRUE(diary.after(0).empty());
  here.pull();
  caller.join();
  EXPECT_EQ(diary.after(2), (std::vector<std::string>{"waiting planned", "waiting ok"}));
}

TEST(Scheduler, NothingStepsHereWhereBatchesGain) {
  CountingDevice device(4);
  Scheduler scheduler(2, device, no_time);
  Diary diary;
  Task task(diary, "task", 1);
  EXPECT_FALSE(scheduler.try_here(task));
}

TEST(Scheduler, RunsATaskOnTheCallersThreadToo) {
  Diary diary;
  CountingDevice device(4);
  Scheduler scheduler(1, device, [] { return int64_t{0}; });
  Task task(diary, "here", 1);
  scheduler.run_here(task);
  EXPECT_EQ(diary.after(0), (Entries{"here planned", "here ok"}));
}

}  // namespace
}  // namespace sightline
