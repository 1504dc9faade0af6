#include "server/base/thread_pool.h"

#include <gtest/gtest.h>

#include <chrono>
#include <vector>

namespace sightline {
namespace {

// Takes every piece of some work on a crew; by piece, which hand took it.
std::vector<size_t> take_all(ThreadPool& crew, size_t pieces) {
  constexpr size_t kNobody = 99;
  std::vector<size_t> taken_by(pieces, kNobody);
  std::atomic<size_t> next{0};
  const auto work = [&](size_t hand) {
    for (size_t i = next++; i < pieces; i = next++) {
      EXPECT_EQ(taken_by[i], kNobody);
      taken_by[i] = hand;
    }
  };
  crew.run(work);
  for (const size_t hand : taken_by) EXPECT_LT(hand, crew.size());
  return taken_by;
}

TEST(ThreadPool, EveryPieceIsDoneWhenItReturnsAsOftenAsItIsCalled) {
  for (const size_t hands : {1, 2, 5}) {
    ThreadPool crew(hands);
    EXPECT_EQ(crew.size(), hands);
    for (size_t call = 0; call < 2000; ++call) take_all(crew, call % 40);
  }
}

// Those that watch and those that sleep. Each call takes long enough for the helper to come, unless others keep it from its core.
TEST(ThreadPool, HelpersComeAwakeAndAsleep) {
  for (const auto pause : {std::chrono::microseconds(0), std::chrono::microseconds(2000)}) {
    ThreadPool crew(2);
    int came = 0;
    for (int call = 0; call < 3000 && came < 5; ++call) {
      std::this_thread::sleep_for(pause);
      std::atomic<bool> here{false};
      crew.run([&](size_t hand) {
        if (hand == 1) here = true;
        const auto end = std::chrono::steady_clock::now() + std::chrono::milliseconds(1);
        while (!here && std::chrono::steady_clock::now() < end) std::this_thread::yield();
      });
      came += here;
    }
    EXPECT_EQ(came, 5);
  }
}

// What a helper wrote can be read without more ado, and what was written before the call is seen by it (of ThreadSanitizer's concern).
TEST(ThreadPool, WorkIsSeenOnBothSides) {
  ThreadPool crew(3);
  std::vector<int> in(300), out(300);
  for (int round = 0; round < 200; ++round) {
    for (int& value : in) value = round;
    std::atomic<size_t> next{0};
    crew.run([&](size_t) {
      for (size_t i = next++; i < in.size(); i = next++) out[i] = in[i] + 1;
    });
    for (const int value : out) ASSERT_EQ(value, round + 1);
  }
}

TEST(ThreadPool, EndsWithoutEverHavingWorked) {
  for (int i = 0; i < 50; ++i) ThreadPool crew(3);
}

}  // namespace
}  // namespace sightline
