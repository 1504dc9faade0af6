#include "server/base/random.h"

#include <gtest/gtest.h>

#include <set>
#include <vector>

namespace sightline {
namespace {

using Block = std::array<uint32_t, 4>;

// "philox4x32 10" of Random123's kat_vectors.
TEST(Philox, GivesTheKnownAnswersOfRandom123) {
  EXPECT_EQ(philox4x32({0, 0, 0, 0}, {0, 0}), (Block{0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8}));
  constexpr uint32_t f = 0xffffffff;
  EXPECT_EQ(philox4x32({f, f, f, f}, {f, f}), (Block{0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd}));
  EXPECT_EQ(philox4x32({0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344}, {0xa4093822, 0x299f31d0}),
            (Block{0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1}));
}

std::vector<uint32_t> first_numbers(CounterRandom random) {
  std::vector<uint32_t> numbers(64);
  for (uint32_t& n : numbers) n = random.next_u32();
  return numbers;
}

TEST(CounterRandom, EqualKeysGiveEqualNumbersAndEveryKeyPartMatters) {
  const auto kTest = RandomPurpose::kTest;
  const auto base = first_numbers({1, 2, kTest});
  EXPECT_EQ(base, first_numbers({1, 2, kTest}));
  const std::set<std::vector<uint32_t>> others = {base,
                                                  first_numbers({2, 2, kTest}),
                                                  first_numbers({1, 3, kTest}),
                                                  first_numbers({1, 2, RandomPurpose::kTexelJitter}),
                                                  first_numbers({1 + (uint64_t{1} << 32), 2, kTest}),
                                                  first_numbers({1, 2 + (uint64_t{1} << 32), kTest})};
  EXPECT_EQ(others.size(), 6u);
}

TEST(CounterRandom, AForkDrawsWhatTheOriginalWould) {
  CounterRandom random(5, 6, RandomPurpose::kTest);
  for (int i = 0; i < 3; ++i) random.next_u32();
  EXPECT_EQ(first_numbers(random), first_numbers(CounterRandom(random)));
}

TEST(CounterRandom, NumbersFillTheirRangeEvenly) {
  CounterRandom random(9, 9, RandomPurpose::kTest);
  std::array<int, 10> below{}, unit{}, in{};
  constexpr int kDraws = 100'000;
  for (int i = 0; i < kDraws; ++i) {
    ++below.at(random.next_below(10));
    const float u = random.next_unit();
    ASSERT_TRUE(u >= 0.0f && u < 1.0f);
    ++unit.at(static_cast<size_t>(u * 10));
    const double d = random.next_in(-5.0, 5.0);
    ASSERT_TRUE(d >= -5.0 && d < 5.0);
    ++in.at(static_cast<size_t>(d + 5.0));
  }
  // Five standard deviations of a binomial count.
  for (const auto& counts : {below, unit, in})
    for (const int count : counts) EXPECT_NEAR(count, kDraws / 10, 475);
}

}  // namespace
}  // namespace sightline
