#include "server/aggregate/viewpoint_map.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <set>

#include "server/base/random.h"
#include "server/sample/embree_sampler.h"
#include "server/scene/primitives.h"
#include "tests/support/round_maps.h"

namespace sightline {
namespace {

using namespace test;

constexpr double kPi = std::numbers::pi;

double azimuth_rad(const glm::dvec3& offset) {
  return std::atan2(offset.z, offset.x);
}
double elevation_rad(const glm::dvec3& offset) {
  return std::asin(offset.y / glm::length(offset));
}

ViewpointMap viewpoints_of(std::vector<uint64_t> ids, double distance_m) {
  ViewpointMap viewpoints;
  viewpoints.follow(ids, distance_m);
  return viewpoints;
}

std::vector<float> shares(const ViewpointMap& viewpoints, size_t target) {
  std::vector<float> all;
  for (size_t place = 0; place < ViewpointMap::kViewpoints; ++place) all.push_back(viewpoints.share(target, place));
  return all;
}

TEST(ViewpointMap, EachViewpointIsTheNearestOneToItself) {
  const ViewpointMap viewpoints = viewpoints_of({1}, 7.0);
  for (size_t place = 0; place < ViewpointMap::kViewpoints; ++place) {
    EXPECT_EQ(viewpoints.nearest_viewpoint(viewpoints.offset_m(place)), place);
    EXPECT_EQ(viewpoints.nearest_viewpoint(1.01 * viewpoints.offset_m(place)), place) << "a little farther out";
  }
}

// Viewpoints are spread evenly over all azimuths, from level to almost overhead, at four distances of which the third
// is the given one. No viewpoint occurs twice.
TEST(ViewpointMap, PlacesStandRoundTheCentre) {
  const ViewpointMap viewpoints = viewpoints_of({1}, 7.0);
  std::set<long> azimuths, elevations, distances;
  std::set<std::array<long, 3>> places;
  const auto rounded = [](double v) { return std::lround(v * 1e6); };
  double lowest = 1, steepest = 0;
  for (size_t place = 0; place < ViewpointMap::kViewpoints; ++place) {
    const glm::dvec3 offset = viewpoints.offset_m(place);
    azimuths.insert(rounded(std::remainder(azimuth_rad(offset), 2 * kPi)));
    elevations.insert(rounded(elevation_rad(offset)));
    distances.insert(rounded(glm::length(offset)));
    places.insert({rounded(offset.x), rounded(offset.y), rounded(offset.z)});
    lowest = std::min(lowest, elevation_rad(offset)), steepest = std::max(steepest, elevation_rad(offset));
  }
  EXPECT_EQ(places.size(), ViewpointMap::kViewpoints);
  EXPECT_EQ(azimuths.size(), ViewpointMap::kAzimuths);
  EXPECT_EQ(elevations.size(), ViewpointMap::kElevations);
  EXPECT_EQ(distances.size(), ViewpointMap::kDistances);
  EXPECT_NEAR(static_cast<double>(*std::next(distances.begin(), 2)) * 1e-6, 7.0, 1e-5);
  EXPECT_NEAR(lowest, 0.0, 0.1) << "level";
  EXPECT_NEAR(steepest, kPi / 2, 0.25) << "almost overhead";
  long last = *azimuths.rbegin() - rounded(2 * kPi);
  for (const long azimuth : azimuths) {
    EXPECT_NEAR(static_cast<double>(azimuth - last) * 1e-6, 2 * kPi / ViewpointMap::kAzimuths, 1e-5);
    last = azimuth;
  }
}

TEST(ViewpointMap, KnowsAsLongAsTheTargetThatLookedForTheShortestTime) {
  ViewpointMap viewpoints;
  EXPECT_EQ(viewpoints.known_s(), 0.0);
  const std::vector<uint64_t> ids = {7, 8};
  viewpoints.follow(ids, 5);
  RoundMaps maps({0, 0, 0}, 8);
  EXPECT_EQ(viewpoints.known_s(), 0.0);
  EXPECT_EQ(shares(viewpoints, 0), std::vector<float>(ViewpointMap::kViewpoints, 1.0f))
      << "what is not known is taken as open";
  viewpoints.learn(0, maps.maps, {0, 0, 0}, 0, 0.1, 1);
  viewpoints.learn(0, maps.maps, {0, 0, 0}, 0, 0.1, 1);
  EXPECT_EQ(viewpoints.known_s(), 0.0);
  viewpoints.learn(1, maps.maps, {0, 0, 0}, 0, 0.15, 1);
  EXPECT_NEAR(viewpoints.known_s(), 0.15, 1e-12);
  viewpoints.forget();
  EXPECT_EQ(viewpoints.known_s(), 0.0);
  EXPECT_EQ(viewpoints.target_count(), 0u);
}

// The reference is a low-pass of hand-made maps that are read without the code under test. Two targets take turns, seen
// from a new point each time. Their centre moves, 10 km from the origin.
class ViewpointMapLearning : public testing::TestWithParam<int> {};
TEST_P(ViewpointMapLearning, IsALowPassOfWhatTheTargetSees) {
  CounterRandom random(51, static_cast<uint64_t>(GetParam()), RandomPurpose::kTest);
  ViewpointMap viewpoints = viewpoints_of({1, 2}, 6.0);
  std::vector<std::vector<double>> expected(2, std::vector<double>(ViewpointMap::kViewpoints, 1.0));
  const auto small = [&] { return glm::dvec3(random.next_in(-1, 1), random.next_in(-1, 1), random.next_in(-1, 1)); };
  glm::dvec3 center(10'000, 3, -10'000);
  int seen = 0, hidden = 0;
  for (int step = 0; step < 24; ++step) {
    const auto target = static_cast<size_t>(step % 2);
    const double since_s = random.next_in(0.005, 0.3), memory_s = random.next_in(0.1, 2.0);
    center += small();
    RoundMaps maps(center + small(), GetParam());
    maps.fill_at_random(random, 0.5, 9.0);
    viewpoints.learn(target, maps.maps, center, 0.01, since_s, memory_s);
    for (size_t place = 0; place < ViewpointMap::kViewpoints; ++place) {
      const bool sees = maps.sees(center + viewpoints.offset_m(place), 0.01);
      const double keep = std::exp(-since_s / memory_s);
      expected[target][place] = keep * expected[target][place] + (1 - keep) * (sees ? 1 : 0);
      ++(sees ? seen : hidden);
    }
    for (size_t i = 0; i < 2; ++i)
      for (size_t place = 0; place < ViewpointMap::kViewpoints; ++place)
        ASSERT_NEAR(viewpoints.share(i, place), expected[i][place], 1e-5) << "step " << step;
  }
  EXPECT_GT(seen, 500);
  EXPECT_GT(hidden, 500);
}
INSTANTIATE_TEST_SUITE_P(Resolutions, ViewpointMapLearning, testing::Values(2, 7, 8, 32));

TEST(ViewpointMap, ForgetsByOneTimeConstant) {
  ViewpointMap viewpoints = viewpoints_of({1}, 6.0);
  RoundMaps open({0, 0, 0}, 4), shut({0, 0, 0}, 4);
  for (DepthMap& map : shut.maps) map.distance_m.assign(map.distance_m.size(), 0.1f);
  viewpoints.learn(0, open.maps, {0, 0, 0}, 0, 0.1, 0.7);
  for (int i = 0; i < 7; ++i) viewpoints.learn(0, shut.maps, {0, 0, 0}, 0, 0.1, 0.7);
  EXPECT_NEAR(viewpoints.share(0, 20), std::exp(-1.0), 1e-5) << "whatever the number of looks in that time";
  viewpoints.learn(0, open.maps, {0, 0, 0}, 0, 0.0, 0.7);
  EXPECT_NEAR(viewpoints.share(0, 20), std::exp(-1.0), 1e-5) << "no time, no change";
  viewpoints.learn(0, open.maps, {0, 0, 0}, 0, 1e6, 0.7);
  EXPECT_NEAR(viewpoints.share(0, 20), 1.0, 1e-6);
}

TEST(ViewpointMap, APlaceThatNoMapShowsStaysAsItWas) {
  ViewpointMap viewpoints = viewpoints_of({1}, 6.0);
  RoundMaps shut({0, 0, 0}, 4);
  for (DepthMap& map : shut.maps) map.distance_m.assign(map.distance_m.size(), 0.1f);
  viewpoints.learn(0, std::span(shut.maps).first(1), {0, 0, 0}, 0, 1e6, 1);
  size_t hidden = 0;
  for (const float share : shares(viewpoints, 0)) hidden += share == 0.0f;
  EXPECT_GT(hidden, 10u);
  EXPECT_LT(hidden, ViewpointMap::kViewpoints / 2);
  // The eye is at the position itself, so there is no direction.
  ViewpointMap at_place = viewpoints_of({1}, 6.0);
  RoundMaps there(at_place.offset_m(17), 4);
  for (DepthMap& map : there.maps) map.distance_m.assign(map.distance_m.size(), 0.0f);
  at_place.learn(0, there.maps, {0, 0, 0}, 0, 1e6, 1);
  EXPECT_EQ(at_place.share(0, 17), 1.0f);
  EXPECT_EQ(at_place.share(0, 18), 0.0f);
}

TEST(ViewpointMap, TargetsThatAreThereAgainKeepWhatWasLearnt) {
  CounterRandom random(52, 0, RandomPurpose::kTest);
  ViewpointMap viewpoints = viewpoints_of({1, 2, 3}, 6.0);
  for (size_t i = 0; i < 3; ++i) {
    RoundMaps maps({0, 0, 0}, 16);
    maps.fill_at_random(random, 1, 8);
    viewpoints.learn(i, maps.maps, {0, 0, 0}, 0, 0.1, 1);
  }
  const auto one = shares(viewpoints, 0), two = shares(viewpoints, 1), three = shares(viewpoints, 2);
  const std::vector<float> unknown(ViewpointMap::kViewpoints, 1.0f);
  ASSERT_NE(one, two);
  const auto expect = [&](std::vector<uint64_t> ids, const std::vector<std::vector<float>>& expected, bool complete) {
    viewpoints.follow(ids, 6.0);
    ASSERT_EQ(viewpoints.target_count(), ids.size());
    for (size_t i = 0; i < ids.size(); ++i) EXPECT_EQ(shares(viewpoints, i), expected[i]) << "target " << ids[i];
    EXPECT_EQ(viewpoints.known_s() > 0, complete);
  };
  expect({3, 1, 2}, {three, one, two}, true);
  expect({2, 3}, {two, three}, true);
  expect({2, 9, 3}, {two, unknown, three}, false);
  expect({1, 2}, {unknown, two}, false);
  expect({}, {}, false);
}

TEST(ViewpointMap, ANewDistanceMovesThePlacesAndKeepsWhatTheyKnow) {
  CounterRandom random(53, 0, RandomPurpose::kTest);
  ViewpointMap viewpoints = viewpoints_of({1}, 6.0);
  RoundMaps maps({0, 0, 0}, 16);
  maps.fill_at_random(random, 1, 8);
  viewpoints.learn(0, maps.maps, {0, 0, 0}, 0, 0.1, 1);
  const auto before = shares(viewpoints, 0);
  const glm::dvec3 offset = viewpoints.offset_m(33);
  const std::vector<uint64_t> ids = {1};
  viewpoints.follow(ids, 12.0);
  EXPECT_EQ(shares(viewpoints, 0), before);
  EXPECT_LT(glm::distance(viewpoints.offset_m(33), 2.0 * offset), 1e-12);
}

// The reference finds neighbours by geometry: one step of azimuth or of elevation, at the same distance.
TEST(ViewpointMap, BesideIsTheMeanOfThePlacesNextToItAtThatDistance) {
  CounterRandom random(54, 0, RandomPurpose::kTest);
  ViewpointMap viewpoints = viewpoints_of({1, 2}, 6.0);
  for (int look = 0; look < 12; ++look) {
    RoundMaps maps({0, 0, 0}, 16);
    maps.fill_at_random(random, 1, 8);
    viewpoints.learn(static_cast<size_t>(look % 2), maps.maps, {0, 0, 0}, 0, 0.5, 1);
  }
  std::vector<double> steps;
  for (size_t place = 0; place < ViewpointMap::kViewpoints; ++place)
    steps.push_back(elevation_rad(viewpoints.offset_m(place)));
  std::sort(steps.begin(), steps.end());
  steps.erase(std::unique(steps.begin(), steps.end(), [](double a, double b) { return b - a < 1e-9; }), steps.end());
  const auto level = [&](const glm::dvec3& offset) {
    return std::lower_bound(steps.begin(), steps.end(), elevation_rad(offset) - 1e-6) - steps.begin();
  };
  for (size_t target = 0; target < 2; ++target)
    for (size_t place = 0; place < ViewpointMap::kViewpoints; ++place) {
      const glm::dvec3 here = viewpoints.offset_m(place);
      double sum = 0;
      int count = 0;
      for (size_t other = 0; other < ViewpointMap::kViewpoints; ++other) {
        const glm::dvec3 there = viewpoints.offset_m(other);
        if (std::abs(glm::length(here) - glm::length(there)) > 1e-9) continue;
        const double turn = std::abs(std::remainder(azimuth_rad(here) - azimuth_rad(there), 2 * kPi));
        const auto rise = std::abs(level(here) - level(there));
        const bool aside = rise == 0 && std::abs(turn - 2 * kPi / ViewpointMap::kAzimuths) < 1e-6;
        if (!aside && !(rise == 1 && turn < 1e-6)) continue;
        sum += static_cast<double>(viewpoints.share(target, other)), ++count;
      }
      ASSERT_TRUE(count == 3 || count == 4);
      EXPECT_NEAR(viewpoints.share_beside(target, place), sum / count, 1e-6);
    }
}

// By rays: a wall on one side of the target hides it from that side and from no other.
TEST(ViewpointMap, LearnsFromRaysThatAWallHidesOneSide) {
  GeometryStore store;
  SceneMirror mirror;
  SceneDelta delta;
  delta.add.push_back(
      {1, *store.intern(*tessellate(BoxShape{{0.1f, 20, 20}})), Pose{{1, 0, 0}, {1, 0, 0, 0}}, glm::dmat3(1), {}});
  ASSERT_TRUE(mirror.apply(delta, {}));
  std::vector<MapView> views;
  plan_round({0.011, 0.017, 0.023}, 8, {0.3, 0.6}, views);
  std::vector<MapRequest> requests;
  for (const MapView& view : views) requests.push_back({.view = view});
  std::vector<DepthMap> maps;
  ASSERT_TRUE(make_embree_sampler_device()->make_sampler()->take(mirror, requests, maps));
  ViewpointMap viewpoints = viewpoints_of({1}, 6.0);
  viewpoints.learn(0, maps, {0, 0, 0}, 0.001, 1e6, 1);
  int hidden = 0;
  for (size_t place = 0; place < ViewpointMap::kViewpoints; ++place) {
    const glm::dvec3 offset = viewpoints.offset_m(place);
    const double x = offset.x;
    // The ray that decides passes up to half a texel away, across the view axis of its face. Only the axis x is at
    // right angles to the wall.
    const double texel_m = 2.0 / 8 * std::max(std::abs(offset.y), std::abs(offset.z));
    if (std::abs(x - 1) < texel_m) continue;
    EXPECT_EQ(viewpoints.share(0, place), x > 1 ? 0.0f : 1.0f) << "x " << x;
    hidden += x > 1;
  }
  EXPECT_GT(hidden, 30);
}

}  // namespace
}  // namespace sightline
