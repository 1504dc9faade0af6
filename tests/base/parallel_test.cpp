#include "server/base/parallel.h"

#include <gtest/gtest.h>

#include <atomic>
#include <numeric>
#include <stdexcept>
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
