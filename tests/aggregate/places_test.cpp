// Candidates given as runs or one by one, compared with a plain list.
#include "server/aggregate/places.h"

#include <gtest/gtest.h>

#include <cmath>

#include "server/aggregate/compose.h"
#include "server/aggregate/lattice.h"
#include "server/sample/plan.h"
#include "tests/aggregate/random_ball.h"

namespace sightline {
namespace {

// A list of candidates, and the same candidates one by one.
struct Case {
  PlaceList list;
  std::vector<glm::dvec3> place_m;
};

Case random_case(CounterRandom& random) {
  Case c;
  const double spacing = random.next_in(0.05, 3);
  const int far = random.next_unit() < 0.3 ? 1'000'000 : 20;
  std::vector<PlaceRun> runs;
  const uint32_t run_count = random.next_below(120);
  for (uint32_t run = 0; run < run_count; ++run) {
    const glm::ivec3 cell(glm::round(random_vector(random, far)));
    runs.push_back({cell, static_cast<uint32_t>(c.place_m.size())});
    const uint32_t length = 1 + random.next_below(random.next_unit() < 0.1 ? 300 : 20);
    for (uint32_t k = 0; k < length; ++k)
      c.place_m.push_back(glm::dvec3(cell.x + static_cast<int>(k), cell.y, cell.z) * spacing);
  }
  c.list.set_runs(spacing, runs, c.place_m.size());
  for (uint32_t k = random.next_below(4); k > 0; --k) {
    c.place_m.push_back(random_vector(random, far * spacing));
    c.list.push_back(c.place_m.back());
  }
  return c;
}

TEST(Places, AreThoseOfThePlainList) {
  CounterRandom random(41, 0, RandomPurpose::kTest);
  size_t tiles = 0;
  for (int trial = 0; trial < 300; ++trial) {
    const Case c = random_case(random);
    ASSERT_EQ(c.list.size(), c.place_m.size());
    std::vector<glm::dvec3> listed, one_by_one;
    list_places(c.list, listed);
    EXPECT_EQ(listed, c.place_m);
    for (const glm::dvec3& place_m : c.list) one_by_one.push_back(place_m);
    EXPECT_EQ(one_by_one, c.place_m);
    for (size_t i = 0; i < c.place_m.size(); ++i) ASSERT_EQ(c.list[i], c.place_m[i]);
    tiles += (c.place_m.size() + kTilePlaces - 1) / kTilePlaces;
  }
  EXPECT_GT(tiles, 350u) << "several tiles a list, at times";
}

TEST(Places, AreInTilesInSinglePrecisionFromAnOrigin) {
  CounterRandom random(42, 0, RandomPurpose::kTest);
  PlaceTile tile;
  for (int trial = 0; trial < 300; ++trial) {
    const Case c = random_case(random);
    const glm::dvec3 origin_m = random_vector(random, 30);
    size_t next = 0;
    for (size_t first = 0; first < c.place_m.size(); first += kTilePlaces) {
      fill_tile(c.list, first, origin_m, tile);
      ASSERT_EQ(tile.first, first);
      for (size_t k = 0; k < tile.count; ++k, ++next) {
        const glm::vec3 expected(c.place_m[next] - origin_m);
        ASSERT_EQ(glm::vec3(tile.x_m[k], tile.y_m[k], tile.z_m[k]), expected) << trial << " place " << next;
      }
      for (size_t k = tile.count; k < tile.count + PlaceTile::kTilePad; ++k) ASSERT_EQ(tile.x_m[k], 0.0f);
    }
    EXPECT_EQ(next, c.place_m.size());
  }
}

TEST(Places, TheirExtentHoldsThemAllAndNoMore) {
  CounterRandom random(43, 0, RandomPurpose::kTest);
  for (int trial = 0; trial < 300; ++trial) {
    const Case c = random_case(random);
    const PlaceExtent extent = extent_of(c.list);
    if (c.place_m.empty()) {
      EXPECT_EQ(extent.radius_m, 0.0);
      continue;
    }
    glm::dvec3 most(0.0);
    double farthest = 0.0;
    for (const glm::dvec3& place_m : c.place_m) {
      const glm::dvec3 off = place_m - extent.middle_m;
      most = glm::max(most, glm::abs(off)), farthest = std::max(farthest, glm::length(off));
    }
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_GE(extent.reach_m[axis], most[axis]);
      EXPECT_LE(extent.reach_m[axis], most[axis] * (1 + 1e-6) + 1e-6);
    }
    EXPECT_GE(extent.radius_m, farthest);
    EXPECT_LE(extent.radius_m, farthest * (1 + 1e-6));
  }
}

// Candidates in runs, single candidates and any number of tiles give the same sights.
TEST(Places, OfRunsAreComposedAsPlacesOneByOne) {
  CounterRandom random(44, 0, RandomPurpose::kTest);
  for (int trial = 0; trial < 20; ++trial) {
    const Bound bound = ball(random_vector(random, 20), random.next_in(0.5, 4));
    Lattice lattice;
    lattice.lay(bound, trial % 2 == 0 ? 343 : 4096);
    PlaceList list;
    list.set_runs(lattice.spacing_m(), lattice.runs(), lattice.size());
    list.push_back(bound.center_m);
    std::vector<glm::dvec3> place_m;
    list_places(list, place_m);
    std::vector<MapView> views;
    std::vector<MapRange> of_point, of_target;
    for (uint32_t point = 0; point < 9; ++point) {
      const auto first = static_cast<uint32_t>(views.size());
      const glm::dvec3 eye_m = bound.center_m + random_vector(random, 3 * bound.radius_m);
      const int count = plan_views(eye_m, bound, {.resolution = 3 + trial}, {0.5, 0.5}, views);
      of_point.push_back({first, static_cast<uint32_t>(count)});
    }
    for (uint32_t target = 0; target < 3; ++target) of_target.push_back({3 * target, 3});
    std::vector<DepthMap> maps;
    for (const MapView& view : views) {
      DepthMap& map = maps.emplace_back();
      map.view = view;
      for (int texel = 0; texel < view.width * view.height; ++texel)
        map.distance_m.push_back(static_cast<float>(bound.radius_m * random.next_in(0.5, 5))),
            map.occluder.push_back(0);
    }
    Composer of_runs, of_singles;
    std::vector<uint32_t> seen_of_runs, seen_of_singles;
    of_runs.set_positions(list), of_singles.set_positions(place_m);
    of_runs.visibility({maps, of_point, of_target, 0.5}, 0.001, seen_of_runs);
    of_singles.visibility({maps, of_point, of_target, 0.5}, 0.001, seen_of_singles);
    ASSERT_EQ(seen_of_runs, seen_of_singles);
    for (size_t i = 0; i < place_m.size(); i += 37)
      for (uint32_t target = 0; target < 3; ++target) {
        uint32_t seen = 0;
        for (uint32_t point = 3 * target; point < 3 * target + 3; ++point)
          seen += look_up(std::span(maps).subspan(of_point[point].first, of_point[point].count), place_m[i], 0.001)
                      .visible;
        ASSERT_EQ((seen_of_runs[i] >> target & 1u) != 0, is_enough(seen, 3, 0.5));
      }
  }
}

}  // namespace
}  // namespace sightline
