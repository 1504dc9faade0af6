#include "server/base/work_limit.h"

#include <gtest/gtest.h>

#include <memory>
#include <thread>
#include <vector>

namespace sightline {
namespace {

// Each look at the clock finds a second more.
thread_local int64_t now_s = 0;
int64_t a_second_a_look() {
  return int64_t{1'000'000'000} * ++now_s;
}
int64_t stands_still() {
  return 0;
}

TEST(WorkLimit, EndsForGoodWhenTheTimeIsUsedUp) {
  WorkLimit limit({.clock = a_second_a_look, .most_ns = 3'000'000'000, .refusal = "too long (--some-flag)"});
  WorkLimit::Part work(&limit);
  for (int look = 0; look < 3; ++look) EXPECT_FALSE(work.ends_now()) << look;
  EXPECT_TRUE(work.ends_now());
  EXPECT_TRUE(work.ends());
  EXPECT_TRUE(limit.ended());
  EXPECT_EQ(limit.error().code, ErrorCode::kResourceExhausted);
  EXPECT_EQ(limit.error().message, "too long (--some-flag)");
}

TEST(WorkLimit, LooksOnlyNowAndThen) {
  WorkLimit limit({.clock = a_second_a_look, .most_ns = 1});
  WorkLimit::Part work(&limit);
  for (int unit = 0; unit < 4095; ++unit) EXPECT_FALSE(work.ends());
  EXPECT_TRUE(work.ends());
}

TEST(WorkLimit, ATimeThatStandsStillEndsNothing) {
  WorkLimit limit({.clock = stands_still, .most_ns = 1});
  WorkLimit::Part work(&limit);
  for (int look = 0; look < 1000; ++look) EXPECT_FALSE(work.ends_now());
}

TEST(WorkLimit, AddsUpTheThreadsAndEndsThemAll) {
  WorkLimit limit({.clock = a_second_a_look, .most_ns = 10'500'000'000});
  WorkLimit::Part own(&limit);
  for (int i = 0; i < 5; ++i)
    std::thread([&] {
      WorkLimit::Part other(&limit);
      EXPECT_FALSE(other.ends_now());
    }).join();  // two seconds each: at its look and at its end
  EXPECT_TRUE(own.ends_now());
  WorkLimit::Part late(&limit);
  EXPECT_TRUE(late.ends());
}

// With the clock of above each look costs a second, whichever part looks. Ten nested parts that look in turns use 30 s,
// not 300.
TEST(WorkLimit, TheTimeOfNestedPartsOfAThreadCountsOnce) {
  WorkLimit limit({.clock = a_second_a_look, .most_ns = 31'000'000'000});
  std::vector<std::unique_ptr<WorkLimit::Part>> parts;
  for (int n = 0; n < 10; ++n) parts.push_back(std::make_unique<WorkLimit::Part>(&limit));
  for (int round = 0; round < 3; ++round)
    for (const auto& part : parts) EXPECT_FALSE(part->ends_now()) << round;
  EXPECT_FALSE(parts.front()->ends_now());
  EXPECT_TRUE(parts.front()->ends_now()) << "32 s";
}

TEST(WorkLimit, EndsWhenNobodyWaits) {
  bool unwanted = false;
  WorkLimit limit({.clock = stands_still}, [&] { return unwanted; });
  WorkLimit::Part work(&limit);
  EXPECT_FALSE(work.ends_now());
  unwanted = true;
  EXPECT_TRUE(work.ends_now());
  EXPECT_EQ(limit.error().code, ErrorCode::kUnavailable);
}

TEST(WorkLimit, WithoutALimitNothingEnds) {
  WorkLimit::Part work(nullptr);
  EXPECT_FALSE(work.ends_now());
}

TEST(WorkLimit, AThreadThatWaitsUsesNoProcessorTime) {
  const int64_t before_ns = thread_cpu_ns();
  const auto start = std::chrono::steady_clock::now();
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  EXPECT_LT(std::chrono::nanoseconds(thread_cpu_ns() - before_ns), std::chrono::steady_clock::now() - start);
}

}  // namespace
}  // namespace sightline
