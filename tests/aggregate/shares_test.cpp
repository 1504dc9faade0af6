// add_shares: the expected seen share of a place, from several samplings of the targets.
#include <gtest/gtest.h>

#include "server/aggregate/compose.h"
#include "tests/support/round_maps.h"

namespace sightline {
namespace {

using namespace test;

// Some targets with some points each, every point with maps of all directions made by hand.
struct Sampling {
  std::vector<RoundMaps> round;  // by point
  std::vector<DepthMap> maps;
  std::vector<MapRange> maps_of_point, points_of_target;

  Sampling(CounterRandom& random, size_t targets, uint32_t most_points) {
    for (size_t t = 0; t < targets; ++t) {
      const uint32_t points = most_points == 0 ? 0 : 1 + random.next_below(most_points);
      points_of_target.push_back({static_cast<uint32_t>(round.size()), points});
      for (uint32_t p = 0; p < points; ++p) {
        RoundMaps& one = round.emplace_back(
            glm::dvec3(random.next_in(-1, 1), random.next_in(-1, 1), random.next_in(-1, 1)),
            2 + static_cast<int>(random.next_below(8)));
        one.fill_at_random(random, 1, 9);
        maps_of_point.push_back({static_cast<uint32_t>(maps.size()), static_cast<uint32_t>(one.maps.size())});
        maps.insert(maps.end(), one.maps.begin(), one.maps.end());
      }
    }
  }
  SampledPoints view() const { return {maps, maps_of_point, points_of_target, 1.0}; }

  double share(const glm::dvec3& place, const std::vector<double>& weights, double bias) {
    double sum = 0, total = 0;
    for (size_t t = 0; t < weights.size(); ++t) {
      total += weights[t];
      double seen = 0;
      for (uint32_t p = 0; p < points_of_target[t].count; ++p)
        seen += round[points_of_target[t].first + p].sees(place, bias);
      if (points_of_target[t].count > 0) sum += weights[t] * seen / points_of_target[t].count;
    }
    return total > 0 ? sum / total : 0.0;
  }
};

std::vector<glm::dvec3> random_places(CounterRandom& random, size_t count) {
  std::vector<glm::dvec3> places;
  for (size_t i = 0; i < count; ++i)
    places.emplace_back(random.next_in(-5, 5), random.next_in(-5, 5), random.next_in(-5, 5));
  return places;
}

class ShareTargets : public testing::TestWithParam<size_t> {};
TEST_P(ShareTargets, AreTheWeighedMeanOfWhatIsSeen) {
  CounterRandom random(71, GetParam(), RandomPurpose::kTest);
  std::vector<uint8_t> scratch;
  double low = 1, high = 0;
  for (int trial = 0; trial < 10; ++trial) {
    Sampling now(random, GetParam(), 16), ahead(random, GetParam(), 3);
    std::vector<double> weights;
    for (size_t t = 0; t < GetParam(); ++t) weights.push_back(t % 4 == 3 ? 0.0 : random.next_in(0.01, 2));
    const auto places = random_places(random, 60);
    const double first = random.next_unit(), bias = random.next_in(0, 0.1);
    std::vector<double> share(places.size(), 0.0);
    add_shares(now.view(), bias, places, weights, first, scratch, share);
    add_shares(ahead.view(), bias, places, weights, 1 - first, scratch, share);
    for (size_t i = 0; i < places.size(); ++i) {
      const double expected =
          first * now.share(places[i], weights, bias) + (1 - first) * ahead.share(places[i], weights, bias);
      ASSERT_NEAR(share[i], expected, 1e-9);
      low = std::min(low, share[i]), high = std::max(high, share[i]);
    }
  }
  EXPECT_LT(low, 0.4);
  EXPECT_GT(high, 0.6);
}
INSTANTIATE_TEST_SUITE_P(Counts, ShareTargets, testing::Values(1, 2, 3, 16, 32));

TEST(Shares, NothingIsAddedWithoutWeight) {
  CounterRandom random(72, 0, RandomPurpose::kTest);
  Sampling sampling(random, 3, 4);
  const auto places = random_places(random, 20);
  std::vector<uint8_t> scratch;
  std::vector<double> share(20, 0.25);
  const std::vector<double> none(3, 0.0), some = {1, 0, 2};
  add_shares(sampling.view(), 0, places, none, 1.0, scratch, share);
  EXPECT_EQ(share, std::vector<double>(20, 0.25));
  add_shares(sampling.view(), 0, places, some, 0.0, scratch, share);
  EXPECT_EQ(share, std::vector<double>(20, 0.25));
  add_shares({}, 0, places, {}, 1.0, scratch, share);
  EXPECT_EQ(share, std::vector<double>(20, 0.25));
}

TEST(Shares, ATargetWithoutPointsIsNotSeen) {
  CounterRandom random(73, 0, RandomPurpose::kTest);
  Sampling sampling(random, 2, 0);
  const auto places = random_places(random, 5);
  std::vector<uint8_t> scratch;
  std::vector<double> share(5, 0.0);
  const std::vector<double> weights = {1, 1};
  add_shares(sampling.view(), 0, places, weights, 1.0, scratch, share);
  EXPECT_EQ(share, std::vector<double>(5, 0.0));
}

TEST(Shares, OfNoPlacesAreNone) {
  CounterRandom random(74, 0, RandomPurpose::kTest);
  Sampling sampling(random, 1, 1);
  std::vector<uint8_t> scratch;
  const std::vector<double> weights = {1};
  add_shares(sampling.view(), 0, {}, weights, 1.0, scratch, {});
  EXPECT_TRUE(scratch.empty());
}

}  // namespace
}  // namespace sightline
