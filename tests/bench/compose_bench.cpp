// Times composition: many candidates looked up in many maps at once, and one by one as the definition says. Both are
// timed alternately in one process, and the ratio of the two is the result.
#include <benchmark/benchmark.h>

#include <array>

#include "server/aggregate/compose.h"
#include "server/base/random.h"
#include "server/sample/plan.h"

namespace sightline {
namespace {

constexpr double kBias = 0.001;

// Points around the origin that look at a ball of candidates 8 m away; a wall stands half-way before some of them.
struct Scene {
  std::vector<DepthMap> maps;
  std::vector<MapRange> maps_of_point, points_of_target;
  std::vector<glm::dvec3> place_m;
  std::vector<double> weight_of_target;
  std::vector<uint8_t> passes = std::vector<uint8_t>(100, 0);

  Scene(size_t places, uint32_t targets, uint32_t points, int resolution) {
    CounterRandom random(1, 0, RandomPurpose::kTexelJitter);
    const Bound bound{.center_m = {0.0, 1.5, 8.0}, .radius_m = 2.5};
    std::vector<MapView> views;
    for (uint32_t target = 0; target < targets; ++target) {
      points_of_target.push_back({target * points, points});
      weight_of_target.push_back(1.0);
      for (uint32_t point = 0; point < points; ++point) {
        const glm::dvec3 eye_m(random.next_in(-3, 3), random.next_in(0, 2), random.next_in(-1, 1));
        maps_of_point.push_back({static_cast<uint32_t>(views.size()), 1});
        plan_views(eye_m, bound, {.resolution = resolution}, {0.5, 0.5}, views);
      }
    }
    for (const MapView& view : views) {
      DepthMap& map = maps.emplace_back();
      map.view = view;
      for (int texel = 0; texel < view.width * view.height; ++texel) {
        const bool wall = random.next_unit() < 0.4;
        map.distance_m.push_back(wall ? 4.0f : std::numeric_limits<float>::infinity());
        map.occluder.push_back(wall ? static_cast<uint32_t>(random.next_in(0, 100)) : kNoOccluder);
      }
    }
    while (place_m.size() < places) {
      const glm::dvec3 place(random.next_in(-2.5, 2.5), random.next_in(-1, 4), random.next_in(5.5, 10.5));
      if (bound.contains(place)) place_m.push_back(place);
    }
    for (size_t slot = 0; slot < passes.size(); slot += 10) passes[slot] = 1;
  }
  SampledPoints sampled() const { return {maps, maps_of_point, points_of_target, 0.75}; }
};

Scene scene_of(const benchmark::State& state) {
  return Scene(static_cast<size_t>(state.range(0)), static_cast<uint32_t>(state.range(1)),
               static_cast<uint32_t>(state.range(2)), static_cast<int>(state.range(3)));
}

void visibility(benchmark::State& state) {
  const Scene scene = scene_of(state);
  Composer composer;
  std::vector<uint32_t> visible;
  for (auto _ : state) {
    composer.set_positions(scene.place_m);
    composer.visibility(scene.sampled(), kBias, visible);
    benchmark::DoNotOptimize(visible.data());
  }
}

void visibility_and_hidden(benchmark::State& state) {
  const Scene scene = scene_of(state);
  Composer composer;
  std::vector<uint32_t> visible;
  HiddenShares hidden;
  for (auto _ : state) {
    composer.set_positions(scene.place_m);
    hidden.reset(scene.place_m.size());
    composer.visibility_and_hidden(scene.sampled(), kBias, {scene.passes, scene.weight_of_target, 1.0}, visible,
                                   hidden);
    benchmark::DoNotOptimize(visible.data());
  }
}

void visibility_one_by_one(benchmark::State& state) {
  const Scene scene = scene_of(state);
  std::vector<uint32_t> visible(scene.place_m.size());
  for (auto _ : state) {
    for (size_t i = 0; i < scene.place_m.size(); ++i) {
      visible[i] = 0;
      for (size_t target = 0; target < scene.points_of_target.size(); ++target) {
        const MapRange& points = scene.points_of_target[target];
        uint32_t seen = 0;
        for (uint32_t k = points.first; k < points.first + points.count; ++k)
          seen += look_up({&scene.maps[k], 1}, scene.place_m[i], kBias).visible;
        if (is_enough(seen, points.count, 0.75)) visible[i] |= 1u << target;
      }
    }
    benchmark::DoNotOptimize(visible.data());
  }
}

// A tile of places in one map, by the widest vectors that the machine has or as elsewhere. r
template <auto kLookAt>
void one_map(benchmark::State& state) {
  const Scene scene(kTilePlaces, 1, 1, static_cast<int>(state.range(0)));
  const PlaceExtent extent = extent_of(scene.place_m);
  std::vector<float> limits_m;
  const PreparedMap map = prepare_map(scene.maps[0], extent, kBias, {}, limits_m);
  PlaceTile tile;
  fill_tile(scene.place_m, 0, extent.middle_m, tile);
  std::array<uint8_t, kTilePlaces + PlaceTile::kTilePad> sights;
  for (auto _ : state) {
    kLookAt(map, limits_m.data(), tile, true, sights.data());
    benchmark::DoNotOptimize(sights);
  }
}
BENCHMARK(one_map<look_at_map>)->Arg(7)->Arg(16);
BENCHMARK(one_map<look_at_map_plainly>)->Arg(7)->Arg(16);

// candidates, targets, points, r
void sizes(benchmark::internal::Benchmark* row) {
  row->Args({343, 2, 1, 7})->Args({343, 2, 8, 7})->Args({4096, 8, 8, 16})->Unit(benchmark::kMicrosecond);
  row->ArgNames({"candidates", "targets", "points", "r"});
}
BENCHMARK(visibility)->Apply(sizes);
BENCHMARK(visibility_and_hidden)->Apply(sizes);
BENCHMARK(visibility_one_by_one)->Apply(sizes);

}  // namespace
}  // namespace sightline

BENCHMARK_MAIN();
