#include "server/base/thread_pool.h"

#include <gtest/gtest.h>

#include <chrono>
#include <vector>

namespace sightline {
namespace {

// Takes every piece once; returns which thread took each.
std::vector<size_t> take_all(ThreadPool& pool, size_t pieces) {
  constexpr size_t kNone = 99;
  std::vector<size_t> taken_by(pieces, kNone);
  std::atomic<size_t> next{0};
  const auto work = [&](size_t thread) {
    for (size_t i = next++; i < pieces; i = next++) {
      EXPECT_EQ(taken_by[i], kNone);
      taken_by[i] = thread;
    }
  };
  pool.run(work);
  for (const size_t thread : taken_by) EXPECT_LT(thread, pool.size());
  return taken_by;
}

TEST(ThreadPool, EveryPieceIsDoneWhenRunReturns) {
  for (const size_t size : {1, 2, 5}) {
    ThreadPool pool(size);
    EXPECT_EQ(pool.size(), size);
    for (size_t call = 0; call < 2000; ++call) take_all(pool, call % 40);
  }
}

// Threads that spin and threads that sleep. Each call is long enough for the helper to wake up, unless other processes
// take its core.
TEST(ThreadPool, HelpersJoinWhetherSpinningOrAsleep) {
  for (const auto pause : {std::chrono::microseconds(0), std::chrono::microseconds(2000)}) {
    ThreadPool pool(2);
    int came = 0;
    for (int call = 0; call < 3000 && came < 5; ++call) {
      std::this_thread::sleep_for(pause);
      std::atomic<bool> here{false};
      pool.run([&](size_t thread) {
        if (thread == 1) here = true;
        const auto end = std::chrono::steady_clock::now() + std::chrono::milliseconds(1);
        while (!here && std::chrono::steady_clock::now() < end) std::this_thread::yield();
      });
      came += here;
    }
    EXPECT_EQ(came, 5);
  }
}

// Only a run whose helper lost its core is followed by runs without helpers. The helper leaves each of these runs at
// once.
TEST(ThreadPool, AHelperThatLeavesInTimeComesToTheNextRunToo) {
  ThreadPool pool(2);
  bool before = false, twice = false;
  for (int call = 0; call < 2000 && !twice; ++call) {
    std::atomic<bool> here{false};
    pool.run([&](size_t thread) {
      if (thread == 1) here = true;
      const auto end = std::chrono::steady_clock::now() + std::chrono::milliseconds(1);
      while (!here && std::chrono::steady_clock::now() < end) std::this_thread::yield();
    });
    twice = here && before;
    before = here;
  }
  EXPECT_TRUE(twice);
}

// A helper sees what was written before the call, and the caller sees what the helper wrote. ThreadSanitizer checks
// both.
TEST(ThreadPool, WorkIsSeenOnBothSides) {
  ThreadPool pool(3);
  std::vector<int> in(300), out(300);
  for (int round = 0; round < 200; ++round) {
    for (int& value : in) value = round;
    std::atomic<size_t> next{0};
    pool.run([&](size_t) {
      for (size_t i = next++; i < in.size(); i = next++) out[i] = in[i] + 1;
    });
    for (const int value : out) ASSERT_EQ(value, round + 1);
  }
}

TEST(ThreadPool, EndsWithoutHavingRun) {
  for (int i = 0; i < 50; ++i) ThreadPool pool(3);
}

}  // namespace
}  // namespace sightline
