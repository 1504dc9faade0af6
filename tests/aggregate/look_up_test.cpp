// Looking up many candidates at once gives the same bits as the plain definition applied to each, also where rounding
// could decide.
#include "server/aggregate/look_up.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "server/base/random.h"
#include "server/sample/plan.h"

namespace sightline {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr float kNotANumber = std::numeric_limits<float>::quiet_NaN();

struct Case {
  std::vector<DepthMap> maps;
  std::vector<glm::dvec3> places;
  std::vector<uint8_t> passes;
  double bias = 0.0;
};

glm::dvec3 random_vector(CounterRandom& random, double size) {
  const double x = random.next_in(-size, size), y = random.next_in(-size, size), z = random.next_in(-size, size);
  return {x, y, z};
}

float random_distance(CounterRandom& random, double near_m) {
  const double kind = random.next_unit();
  if (kind < 0.3) return static_cast<float>(kInfinity);
  if (kind < 0.33) return kNotANumber;
  if (kind < 0.36) return 0.0f;
  if (kind < 0.38) return -1.0f;
  return static_cast<float>(near_m * random.next_in(0.2, 2.0));
}

// Views of a ball as the plan arranges them: one map when the eye is far away, up to six when it is near or inside.
Case random_case(CounterRandom& random) {
  Case c;
  const double size = std::exp(random.next_in(-2, 4));
  const Bound bound{.center_m = random_vector(random, random.next_unit() < 0.2 ? 1e5 : 30.0), .radius_m = size};
  const glm::dvec3 eye = bound.center_m + random_vector(random, size * random.next_in(0.0, 5.0));
  std::vector<MapView> views;
  const int resolution = 2 + static_cast<int>(random.next_in(0, 31));
  plan_views(eye, bound, {.resolution = resolution}, {random.next_unit(), random.next_unit()}, views);
  c.passes.resize(50);
  for (uint8_t& passes : c.passes) passes = random.next_unit() < 0.3;
  for (const MapView& view : views) {
    DepthMap& map = c.maps.emplace_back();
    map.view = view;
    for (int i = 0; i < view.width * view.height; ++i) {
      map.distance_m.push_back(random_distance(random, glm::distance(eye, bound.center_m) + 0.1));
      map.occluder.push_back(std::isinf(map.distance_m.back()) ? kNoOccluder
                                                               : static_cast<uint32_t>(random.next_in(0, 50)));
    }
  }
  c.bias = random.next_unit() < 0.5 ? 0.0 : random.next_in(0, 0.1);
  while (c.places.size() < 700) c.places.push_back(bound.center_m + random_vector(random, size * 1.2));
  return c;
}

// Candidates at the window's edges, on the texels' rays and in the middle between them, exactly at the texel's depth:
// the last bit decides.
void add_places_on_edges(CounterRandom& random, Case& c) {
  for (const DepthMap& map : c.maps)
    for (int i = 0; i < 200; ++i) {
      const int x = static_cast<int>(random.next_in(0, map.view.width + 1)),
                y = static_cast<int>(random.next_in(0, map.view.height + 1));
      MapView edges = map.view;
      const double kind = random.next_unit();
      if (kind < 0.3)
        edges.jitter = glm::dvec2(0.0);
      else if (kind < 0.6)
        edges.jitter.x = 0.0;
      else if (kind < 0.9)
        edges.jitter.x -= 0.5;
      const glm::dvec3 along = glm::normalize(texel_direction(edges, x, y));
      const double far_m = map.distance_at(std::min(x, map.view.width - 1), std::min(y, map.view.height - 1));
      const double at_m = std::isfinite(far_m) && far_m > 0 ? far_m * (1 + c.bias) : random.next_in(0.1, 9);
      c.places.push_back(map.view.eye_m + along * at_m);
      c.places.push_back(map.view.eye_m + along * std::nextafter(at_m, kInfinity));
    }
  const MapView& view = c.maps[0].view;
  c.places.push_back(view.eye_m);
  c.places.push_back(view.eye_m + view.world_from_view[0]);  // in the eye's plane
  c.places.push_back(view.eye_m + 1e-9 * view.world_from_view[2]);
}

// All candidates, tile by tile.
std::vector<uint8_t> look_at_all(LookUp& look_up_all, const Case& c, std::span<const uint8_t> passes,
                                 bool& any_passing) {
  std::vector<uint8_t> sights;
  look_up_all.set_places(c.places);
  look_up_all.begin_maps(c.bias, passes);
  const size_t first = look_up_all.add_maps(c.maps);
  any_passing = false;
  SightTile tile;
  for (size_t number = 0; number < look_up_all.tile_count(); ++number) {
    look_up_all.load_tile(number, tile);
    EXPECT_EQ(tile.places.first, sights.size());
    const std::span<const uint8_t> of_tile = look_up_all.look(first, c.maps.size(), tile);
    sights.insert(sights.end(), of_tile.begin(), of_tile.end());
    any_passing |= look_up_all.any_passing();
  }
  EXPECT_EQ(sights.size(), c.places.size());
  return sights;
}

int32_t expected_sight(const Case& c, const glm::dvec3& place) {
  const Sight sight = look_up(c.maps, place, c.bias);
  if (!sight.known) return kUnknownSight;
  if (sight.visible) return kVisibleSight;
  return sight.occluder != kNoOccluder && c.passes[sight.occluder] ? kPassingSight : kHiddenSight;
}

TEST(LookUp, AgreesWithTheDefinitionForEveryCandidate) {
  CounterRandom random(5, 0, RandomPurpose::kTest);
  LookUp look_up_all;
  std::array<size_t, 4> found{};
  size_t singly = 0, all = 0, several_maps = 0;
  for (int trial = 0; trial < 300; ++trial) {
    Case c = random_case(random);
    const size_t plain = c.places.size();
    bool found_passing = false;
    look_at_all(look_up_all, c, c.passes, found_passing);
    singly += look_up_all.exact_count(), all += plain;
    add_places_on_edges(random, c);
    several_maps += c.maps.size() > 1;
    const std::vector<uint8_t> sights = look_at_all(look_up_all, c, c.passes, found_passing);
    bool any_passing = false;
    for (size_t i = 0; i < c.places.size(); ++i) {
      const int32_t expected = expected_sight(c, c.places[i]);
      ASSERT_EQ(sights[i], expected) << "trial " << trial << " place " << i << " of " << plain;
      ++found[static_cast<size_t>(expected)];
      any_passing |= expected == kPassingSight;
    }
    EXPECT_TRUE(found_passing || !any_passing);
  }
  for (const size_t count : found) EXPECT_GT(count, 10000u);
  EXPECT_GT(several_maps, 50u);
  EXPECT_GT(singly, 0u);
  EXPECT_LT(singly, all / 20) << "texels of no number among them";
}

// The definition, against a search of all rays.
TEST(LookUp, TheRayThatPassesNearestDecides) {
  CounterRandom random(9, 0, RandomPurpose::kTest);
  int at_the_edge = 0;
  for (int trial = 0; trial < 5000; ++trial) {
    DepthMap map;
    map.view.width = 1 + static_cast<int>(random.next_below(9)),
    map.view.height = 1 + static_cast<int>(random.next_below(9));
    map.view.jitter = {random.next_unit(), random.next_unit()};
    for (int i = 0; i < map.view.width * map.view.height; ++i)
      map.distance_m.push_back(random.next_unit() < 0.5 ? 1.0f : 100.0f);
    map.occluder.assign(map.distance_m.size(), 5);
    const glm::dvec3 place_m(random.next_in(-9, 9), random.next_in(-9, 9), -9);
    const auto nearest = [&](double at_window, int count, double jitter) {
      const auto away = [&](int k) { return std::abs((k + jitter) / count * 18 - 9 - at_window); };
      int best = 0;
      for (int k = 1; k < count; ++k)
        if (away(k) < away(best)) best = k;
      return best;
    };
    const int x = nearest(place_m.x, map.view.width, map.view.jitter.x),
              y = nearest(place_m.y, map.view.height, map.view.jitter.y);
    const Sight sight = look_up(std::span(&map, 1), place_m, 0.0);
    EXPECT_TRUE(sight.known);
    EXPECT_EQ(sight.visible, map.distance_at(x, y) == 100.0f) << trial;
    at_the_edge += place_m.x < (map.view.jitter.x - 0.5) / map.view.width * 18 - 9;
  }
  EXPECT_GT(at_the_edge, 50) << "where no ray passes within half a texel";
}

// However coarse the map is.
TEST(LookUp, AWallAcrossTheViewHidesExactlyWhatIsBehindIt) {
  CounterRandom random(10, 0, RandomPurpose::kTest);
  for (int trial = 0; trial < 3000; ++trial) {
    const double wall_m = random.next_in(0.5, 9);
    DepthMap map;
    map.view.width = map.view.height = 1 + static_cast<int>(random.next_below(6));
    map.view.jitter = {random.next_unit(), random.next_unit()};
    for (int y = 0; y < map.view.height; ++y)
      for (int x = 0; x < map.view.width; ++x)
        map.distance_m.push_back(static_cast<float>(wall_m * glm::length(texel_direction(map.view, x, y))));
    map.occluder.assign(map.distance_m.size(), 5);
    const double depth_m = wall_m + random.next_in(-0.01, 0.01);
    const glm::dvec3 place_m(random.next_in(-depth_m, depth_m), random.next_in(-depth_m, depth_m), -depth_m);
    if (std::abs(depth_m - wall_m) < 1e-5) continue;
    EXPECT_EQ(look_up(std::span(&map, 1), place_m, 0.0).visible, depth_m < wall_m) << trial;
  }
}

TEST(LookUp, HiddenIsHiddenByWhatStaysWhenNothingPasses) {
  CounterRandom random(6, 0, RandomPurpose::kTest);
  const Case c = random_case(random);
  LookUp look_up_all;
  bool found_passing = true;
  const std::vector<uint8_t> sights = look_at_all(look_up_all, c, {}, found_passing);
  for (size_t i = 0; i < c.places.size(); ++i) {
    const int32_t expected = expected_sight(c, c.places[i]);
    EXPECT_EQ(sights[i], expected == kPassingSight ? kHiddenSight : expected);
  }
  EXPECT_FALSE(found_passing);
}

TEST(LookUp, PlacesThatAreNoNumbersAreUnknownAndLeaveTheOthersAsTheyAre) {
  CounterRandom random(7, 0, RandomPurpose::kTest);
  Case c = random_case(random);
  c.places[3].x = std::numeric_limits<double>::quiet_NaN();
  c.places[500] = {kInfinity, 0, 0};
  LookUp look_up_all;
  bool found_passing = false;
  const std::vector<uint8_t> sights = look_at_all(look_up_all, c, c.passes, found_passing);
  for (size_t i = 0; i < c.places.size(); ++i) EXPECT_EQ(sights[i], expected_sight(c, c.places[i])) << i;
}

TEST(LookUp, NoMapsOrNoCandidatesGiveNoSights) {
  LookUp look_up_all;
  Case c;
  bool found_passing = false;
  EXPECT_TRUE(look_at_all(look_up_all, c, {}, found_passing).empty());
  c.places = {{0, 0, -5}};
  EXPECT_EQ(look_at_all(look_up_all, c, {}, found_passing)[0], kUnknownSight);
}

// Tests the portable and the vectorised lookup, where the machine has the second. Where either is sure, it must agree
// with the definition.
TEST(LookUp, PortableAndVectorisedLookupsAgree) {
  CounterRandom random(8, 0, RandomPurpose::kTest);
  for (int trial = 0; trial < 100; ++trial) {
    Case c = random_case(random);
    add_places_on_edges(random, c);
    const PlaceExtent extent = extent_of(c.places);
    std::vector<float> limits_m;
    std::vector<PreparedMap> maps;
    for (const DepthMap& map : c.maps) maps.push_back(prepare_map(map, extent, c.bias, c.passes, limits_m));
    PlaceTile tile;
    for (size_t first = 0; first < c.places.size(); first += kTilePlaces) {
      fill_tile(c.places, first, extent.middle_m, tile);
      std::array<std::array<uint8_t, kTilePlaces + PlaceTile::kTilePad>, 2> sights;
      for (size_t k = 0; k < maps.size(); ++k) {
        look_at_map(maps[k], limits_m.data(), tile, k == 0, sights[0].data());
        look_at_map_plainly(maps[k], limits_m.data(), tile, k == 0, sights[1].data());
      }
      for (size_t i = 0; i < tile.count; ++i)
        for (const auto& way : sights)
          ASSERT_TRUE(way[i] == kUnsureSight || way[i] == expected_sight(c, c.places[first + i])) << trial;
    }
  }
}

}  // namespace
}  // namespace sightline
