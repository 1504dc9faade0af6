// Composer::add_hidden: the weighted share of the targets that a candidate is expected not to see, from several
// samplings.
#include <gtest/gtest.h>

#include <array>

#include "server/aggregate/compose.h"
#include "tests/support/round_maps.h"

namespace sightline {
namespace {

using namespace test;

// Some targets with some points each. Every point has hand-made maps of all directions.
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
        for (DepthMap& map : one.maps)
          for (uint32_t& slot : map.occluder) slot = std::array{0u, 1u, kNoOccluder}[random.next_below(3)];
        maps_of_point.push_back({static_cast<uint32_t>(maps.size()), static_cast<uint32_t>(one.maps.size())});
        maps.insert(maps.end(), one.maps.begin(), one.maps.end());
      }
    }
  }
  SampledPoints view() const { return {maps, maps_of_point, points_of_target, 1.0}; }

  // The share that is hidden by moving occluders (slot 1) when `by_moving`, else by all others.
  double hidden(const glm::dvec3& place, const std::vector<double>& weights, double bias, bool by_moving) {
    double sum = 0, total = 0;
    for (size_t t = 0; t < weights.size(); ++t) {
      total += weights[t];
      double count = 0;
      for (uint32_t p = 0; p < points_of_target[t].count; ++p) {
        RoundMaps& one = round[points_of_target[t].first + p];
        count += !one.sees(place, bias) && (one.occluder(place) == 1u) == by_moving;
      }
      if (points_of_target[t].count > 0) sum += weights[t] * count / points_of_target[t].count;
    }
    return total > 0 ? sum / total : 0.0;
  }
};

// The second of the two occluders is one that moves past.
const std::vector<uint8_t> kPasses = {0, 1};

std::vector<glm::dvec3> random_places(CounterRandom& random, size_t count) {
  std::vector<glm::dvec3> places;
  for (size_t i = 0; i < count; ++i)
    places.emplace_back(random.next_in(-5, 5), random.next_in(-5, 5), random.next_in(-5, 5));
  return places;
}

class ShareTargets : public testing::TestWithParam<size_t> {};
TEST_P(ShareTargets, AreTheWeighedMeanOfWhatIsSeen) {
  CounterRandom random(71, GetParam(), RandomPurpose::kTest);
  double low = 1, high = 0;
  for (int trial = 0; trial < 10; ++trial) {
    Sampling now(random, GetParam(), 16), ahead(random, GetParam(), 3);
    std::vector<double> weights;
    for (size_t t = 0; t < GetParam(); ++t) weights.push_back(t % 4 == 3 ? 0.0 : random.next_in(0.01, 2));
    const auto places = random_places(random, 60);
    const double first = random.next_unit(), bias = random.next_in(0, 0.1);
    HiddenShares share;
    share.reset(places.size());
    Composer composer;
    composer.set_positions(places);
    composer.add_hidden(now.view(), bias, {kPasses, weights, first}, share);
    composer.add_hidden(ahead.view(), bias, {kPasses, weights, 1 - first}, share);
    for (size_t i = 0; i < places.size(); ++i)
      for (const bool by_moving : {false, true}) {
        const double expected = first * now.hidden(places[i], weights, bias, by_moving) +
                                (1 - first) * ahead.hidden(places[i], weights, bias, by_moving);
        const double got = (by_moving ? share.by_passing : share.by_staying)[i];
        ASSERT_NEAR(got, expected, 1e-9);
        low = std::min(low, got), high = std::max(high, got);
      }
  }
  EXPECT_LT(low, 0.2);
  EXPECT_GT(high, 0.3);
}
INSTANTIATE_TEST_SUITE_P(Counts, ShareTargets, testing::Values(1, 2, 3, 16, 32));

TEST(Shares, NothingIsAddedWithoutWeightOrPointsOrPlaces) {
  CounterRandom random(72, 0, RandomPurpose::kTest);
  Sampling sampling(random, 3, 4), without_points(random, 3, 0);
  const auto places = random_places(random, 20);
  HiddenShares share;
  share.reset(20);
  Composer composer;
  composer.set_positions(places);
  const std::vector<double> none(3, 0.0), some = {1, 0, 2}, nothing(20, 0.0);
  composer.add_hidden(sampling.view(), 0, {kPasses, none, 1.0}, share);
  composer.add_hidden(sampling.view(), 0, {kPasses, some, 0.0}, share);
  composer.add_hidden({}, 0, {kPasses, {}, 1.0}, share);
  composer.add_hidden(without_points.view(), 0, {kPasses, some, 1.0}, share);
  EXPECT_EQ(share.by_passing, nothing);
  EXPECT_EQ(share.by_staying, nothing);
  share.reset(0);
  composer.set_positions({});
  composer.add_hidden(sampling.view(), 0, {kPasses, some, 1.0}, share);
  EXPECT_TRUE(share.by_passing.empty() && share.by_staying.empty());
}

}  // namespace
}  // namespace sightline
