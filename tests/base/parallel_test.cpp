#include "server/base/parallel.h"

#include <gtest/gtest.h>
#include <sched.h>

#include <atomic>
#include <numeric>
#include <stdexcept>
#include <thread>
#include <vector>

namespace sightline {
namespace {

TEST(ParallelFor, EveryPieceIsVisitedOnce) {
  for (const size_t count : {0, 1, 2, 3, 1000}) {
    std::vector<std::atomic<int>> visits(count);
    parallel_for(count, [&](size_t i) { ++visits[i]; });
    for (size_t i = 0; i < count; ++i) EXPECT_EQ(visits[i], 1) << i << " of " << count;
  }
}

// A process that may use one CPU gains nothing from a second thread.
TEST(ParallelFor, ItStartsNoMoreThreadsThanTheProcessMayUse) {
  cpu_set_t before, one;
  ASSERT_EQ(sched_getaffinity(0, sizeof before, &before), 0);
  CPU_ZERO(&one);
  for (int cpu = 0; cpu < CPU_SETSIZE && CPU_COUNT(&one) == 0; ++cpu)
    if (CPU_ISSET(cpu, &before)) CPU_SET(cpu, &one);
  ASSERT_EQ(sched_setaffinity(0, sizeof one, &one), 0);
  std::vector<std::thread::id> threads(200);
  parallel_for(threads.size(), [&](size_t i) { threads[i] = std::this_thread::get_id(); });
  ASSERT_EQ(sched_setaffinity(0, sizeof before, &before), 0);
  for (const std::thread::id& thread : threads) EXPECT_EQ(thread, std::this_thread::get_id());
}

TEST(ParallelFor, PiecesMayBePartedFurther) {
  std::vector<size_t> sums(50);
  parallel_for(sums.size(), [&](size_t i) {
    std::vector<size_t> parts(20);
    parallel_for(parts.size(), [&](size_t k) { parts[k] = i * k; });
    sums[i] = std::accumulate(parts.begin(), parts.end(), size_t{0});
  });
  for (size_t i = 0; i < sums.size(); ++i) EXPECT_EQ(sums[i], i * 190);
}

TEST(ParallelFor, TheExceptionOfTheFirstPieceIsThrownAndTheOthersAreDone) {
  std::atomic<int> done{0};
  try {
    parallel_for(100, [&](size_t i) {
      if (i % 10 == 7) throw std::runtime_error(std::to_string(i));
      ++done;
    });
    FAIL() << "nothing was thrown";
  } catch (const std::runtime_error& error) {
    EXPECT_STREQ(error.what(), "7");
  }
  EXPECT_EQ(done, 90);
}

}  // namespace
}  // namespace sightline
