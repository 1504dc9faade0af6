#include "server/record/record_ring.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <thread>

#include "server/base/random.h"

namespace sightline {
namespace {

TEST(RecordRing, GivesBackEveryMessageInOrderToAnotherThread) {
  RecordRing ring(8192);
  constexpr uint64_t kMessages = 200'000;
  std::thread producer([&] {
    CounterRandom random(3, 0, RandomPurpose::kTest);
    for (uint64_t i = 0; i < kMessages;) {
      const size_t size = random.next_below(300);
      char* at = ring.reserve(size);
      while (at == nullptr) {
        std::this_thread::yield();
        at = ring.reserve(size);
      }
      std::fill_n(at, size, static_cast<char>(i));
      ring.commit({static_cast<uint32_t>(size), 0, 0, static_cast<uint32_t>(i), 0, i, size});
      ++i;
    }
  });
  uint64_t right = 0;
  for (uint64_t i = 0; i < kMessages;) {
    RecordEntry entry;
    if (!ring.front(entry)) {
      std::this_thread::yield();
      continue;
    }
    const bool filled = std::all_of(entry.message.begin(), entry.message.end(),
                                    [&](char c) { return c == static_cast<char>(i); });
    right += entry.head.sequence == i && entry.head.log_time_ns == i &&
             entry.message.size() == entry.head.publish_time_ns && filled;
    ring.pop();
    ++i;
  }
  producer.join();
  EXPECT_EQ(right, kMessages);
}

TEST(RecordRing, HoldsAMessageOfHalfItsSizeWhereverItStands) {
  RecordRing ring(4096);
  RecordEntry entry;
  for (size_t i = 0; i < 2000; ++i) {
    const size_t size = i % 3 == 0 ? ring.max_message() : i % 100;
    ASSERT_NE(ring.reserve(size), nullptr) << i;
    ring.commit({.size = static_cast<uint32_t>(size), .sequence = static_cast<uint32_t>(i)});
    ASSERT_TRUE(ring.front(entry));
    EXPECT_EQ(entry.message.size(), size);
    ring.pop();
    EXPECT_FALSE(ring.front(entry));
  }
  EXPECT_EQ(ring.reserve(ring.max_message() + 1), nullptr);
}

}  // namespace
}  // namespace sightline
