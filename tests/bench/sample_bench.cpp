// Times depth maps over a city of 400 blocks and about 280 K triangles: both samplers, by map size, number of maps and
// what changes between takes. EGL runs in the environment as it is: compare LP_NUM_THREADS=0, 1, 2.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <memory>
#include <vector>

#include "server/base/random.h"
#include "server/gl/software_renderer.h"
#include "server/sample/egl_sampler.h"
#include "server/sample/embree_sampler.h"
#include "server/sample/embree_scene.h"
#include "server/scene/mirror.h"

namespace sightline {
namespace {

constexpr int kBlocksASide = 20;
constexpr int kMovers = 10;
constexpr double kBlockSpacingM = 30.0;

// A box with every face cut into n x n cells: 12 n^2 triangles.
MeshData subdivided_box(const glm::vec3& half, int n) {
  MeshData mesh;
  for (int axis = 0; axis < 3; ++axis)
    for (const float side : {-1.0f, 1.0f}) {
      const uint32_t base = static_cast<uint32_t>(mesh.positions.size());
      for (int j = 0; j <= n; ++j)
        for (int i = 0; i <= n; ++i) {
          glm::vec3 p;
          p[axis] = side;
          p[(axis + 1) % 3] = -1.0f + 2.0f * static_cast<float>(i) / static_cast<float>(n);
          p[(axis + 2) % 3] = -1.0f + 2.0f * static_cast<float>(j) / static_cast<float>(n);
          mesh.positions.push_back(p * half);
        }
      const uint32_t row = static_cast<uint32_t>(n) + 1;
      for (uint32_t j = 0; j + 1 < row; ++j)
        for (uint32_t i = 0; i + 1 < row; ++i) {
          const uint32_t a = base + j * row + i;
          mesh.indices.insert(mesh.indices.end(), {a, a + 1, a + row + 1, a, a + row + 1, a + row});
        }
    }
  return mesh;
}

struct CityOptions {
  int blocks_a_side = kBlocksASide;
  int cells = 8;  // a block's face is cut into about cells x cells
  int movers = kMovers;
  uint64_t seed = 1;
};

struct City {
  SceneMirror mirror;
  std::vector<uint64_t> movers;
  std::vector<uint32_t> target_slots;

  explicit City(const CityOptions& options = {}) {
    const uint64_t seed = options.seed;
    CounterRandom random(seed, 0, RandomPurpose::kTest);
    SceneDelta delta;
    uint64_t id = 1;
    // Blocks of 12 * 7^2 or 12 * 8^2 triangles: 283 K together.
    const double middle = 0.5 * (options.blocks_a_side - 1);
    for (int z = 0; z < options.blocks_a_side; ++z)
      for (int x = 0; x < options.blocks_a_side; ++x, ++id) {
        const glm::vec3 half(random.next_in(6, 11), random.next_in(5, 30), random.next_in(6, 11));
        const int cells = options.cells - (id % 3 == 0 ? 1 : 0);
        delta.add.push_back({.id = id,
                             .geometry = build_geometry(subdivided_box(half, cells)).value(),
                             .pose = {{(x - middle) * kBlockSpacingM, half.y, (z - middle) * kBlockSpacingM}},
                             .attributes = {}});
      }
    const auto mover = build_geometry(subdivided_box({0.4f, 0.9f, 0.4f}, 3)).value();
    for (int i = 0; i < options.movers; ++i, ++id) {
      movers.push_back(id);
      delta.add.push_back({.id = id, .geometry = mover, .pose = pose_of(i, 0), .attributes = {}, .moving = true});
    }
    if (!mirror.apply(delta, {})) std::abort();
    for (const uint64_t mover_id : movers) target_slots.push_back(*mirror.slot_of(mover_id));
  }

  // Movers walk the streets, which run between the blocks.
  static Pose pose_of(int mover, int tick) {
    const double street = (mover % 5 - 2) * kBlockSpacingM;
    return {{street, 1.7, mover * 7.0 - 30.0 + 0.05 * tick}};
  }
  void walk(int tick) {
    TransformUpdate update;
    update.ids = movers;
    for (size_t i = 0; i < movers.size(); ++i) update.poses.push_back(pose_of(static_cast<int>(i), tick));
    if (!mirror.apply({}, update)) std::abort();
  }
};

// A frustum from each of the first targets around a bound 6 m behind and above it.
std::vector<MapRequest> requests_for(const City& city, int maps, int resolution, int tick) {
  std::vector<MapRequest> requests;
  CounterRandom random(7, static_cast<uint64_t>(tick), RandomPurpose::kTexelJitter);
  for (int i = 0; i < maps; ++i) {
    const size_t target = static_cast<size_t>(i) % std::min<size_t>(kMovers, city.movers.size());
    MapView view;
    view.eye_m = city.mirror.find(city.movers[target])->pose.position_m;
    const glm::dvec3 forward = glm::normalize(glm::dvec3(0.6 + 0.1 * i, 0.5, 5.5));
    view.world_from_view = glm::mat3_cast(look_rotation(forward, {0, 1, 0}, {1, 0, 0}));
    view.left = view.bottom = -0.25;
    view.right = view.top = 0.25;
    view.width = view.height = resolution;
    view.jitter = {random.next_unit(), random.next_unit()};
    requests.push_back({.view = view, .ignored_slots = std::span(&city.target_slots[target], 1)});
  }
  return requests;
}

void take_city(benchmark::State& state, SamplerDevice& device, const CityOptions& options, int map_count,
               int resolution) {
  City city(options);
  const auto sampler = device.make_sampler();
  std::vector<DepthMap> maps;
  // Shaders are compiled and geometry is uploaded by the first takes.
  std::vector<double> takes_us;
  int tick = 0;
  const auto take = [&] {
    city.walk(++tick);
    const auto requests = requests_for(city, map_count, resolution, tick);
    const auto start = std::chrono::steady_clock::now();
    if (!sampler->take(city.mirror, requests, maps)) state.SkipWithError("take failed");
    benchmark::DoNotOptimize(maps.data());
    return std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - start).count();
  };
  for (int i = 0; i < 20; ++i) take();
  for (auto _ : state) takes_us.push_back(take());
  std::sort(takes_us.begin(), takes_us.end());
  state.counters["p50_us"] = takes_us[takes_us.size() / 2];
  state.counters["p99_us"] = takes_us[takes_us.size() * 99 / 100];
  state.SetLabel(device.renderer());
}

void egl_city(benchmark::State& state) {
  prepare_software_rendering();
  auto device = make_egl_sampler_device({});
  if (!device) return state.SkipWithError("no EGL context");
  take_city(state, **device, {}, static_cast<int>(state.range(0)), static_cast<int>(state.range(1)));
}

// How a take grows with the triangles of the scene: 28 K, 280 K and 2.8 M, by finer meshes and by more blocks.
void egl_growth(benchmark::State& state) {
  prepare_software_rendering();
  auto device = make_egl_sampler_device({});
  if (!device) return state.SkipWithError("no EGL context");
  take_city(state, **device,
            {.blocks_a_side = static_cast<int>(state.range(0)), .cells = static_cast<int>(state.range(1))}, 2, 7);
}

// How it grows with moving occluders, of 10,000 instances.
void egl_movers(benchmark::State& state) {
  prepare_software_rendering();
  auto device = make_egl_sampler_device({});
  if (!device) return state.SkipWithError("no EGL context");
  take_city(state, **device, {.blocks_a_side = 100, .cells = 2, .movers = static_cast<int>(state.range(0))}, 2, 7);
}

// Each session takes two maps: one session after the other, or all in one round.
void egl_sessions(benchmark::State& state) {
  prepare_software_rendering();
  auto device = make_egl_sampler_device({});
  if (!device) return state.SkipWithError("no EGL context");
  const auto count = static_cast<size_t>(state.range(0));
  const bool together = state.range(1) != 0;
  std::vector<std::unique_ptr<City>> cities;
  std::vector<std::unique_ptr<Sampler>> samplers;
  std::vector<std::vector<DepthMap>> maps(count);
  for (size_t i = 0; i < count; ++i) {
    cities.push_back(std::make_unique<City>(CityOptions{.seed = 1 + i}));
    samplers.push_back((*device)->make_sampler());
  }
  int tick = 0;
  std::vector<std::vector<MapRequest>> requests(count);
  std::vector<TakeJob> jobs(count);
  const auto move_on = [&] {
    ++tick;
    for (size_t i = 0; i < count; ++i) {
      cities[i]->walk(tick);
      requests[i] = requests_for(*cities[i], 2, 7, tick);
      jobs[i] = {samplers[i].get(), &cities[i]->mirror, requests[i], &maps[i], {}};
    }
  };
  move_on();
  (*device)->take_all(jobs);  // compiles shaders
  for (auto _ : state) {
    state.PauseTiming();
    move_on();
    state.ResumeTiming();
    if (together)
      (*device)->take_all(jobs);
    else
      for (TakeJob& job : jobs) job.taken = job.sampler->take(*job.mirror, job.requests, *job.maps);
    for (const TakeJob& job : jobs)
      if (!job.taken) return state.SkipWithError("take failed");
  }
  state.counters["a_session_us"] = benchmark::Counter(
      1e-6 * static_cast<double>(count), benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}

void embree_city(benchmark::State& state) {
  take_city(state, *make_embree_sampler_device(), {}, static_cast<int>(state.range(0)),
            static_cast<int>(state.range(1)));
}

// The same texels as single ray queries over the same scene; embree_city takes them in packets.
void embree_single_rays(benchmark::State& state) {
  City city;
  EmbreeDevice device;
  EmbreeScene scene(device, EmbreeScene::Content::kOccluders);
  const int map_count = static_cast<int>(state.range(0)), resolution = static_cast<int>(state.range(1));
  std::vector<double> takes_us;
  int tick = 0;
  for (auto _ : state) {
    city.walk(++tick);
    const auto requests = requests_for(city, map_count, resolution, tick);
    const auto start = std::chrono::steady_clock::now();
    scene.take_in(city.mirror);
    for (const MapRequest& request : requests)
      for (int y = 0; y < resolution; ++y)
        for (int x = 0; x < resolution; ++x)
          benchmark::DoNotOptimize(scene.trace(request.view.eye_m, glm::vec3(texel_direction(request.view, x, y)),
                                               static_cast<float>(request.view.near_m),
                                               std::numeric_limits<float>::infinity(),
                                               {.ignored_slots = request.ignored_slots}));
    takes_us.push_back(std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - start).count());
  }
  std::sort(takes_us.begin(), takes_us.end());
  state.counters["p50_us"] = takes_us[takes_us.size() / 2];
  state.counters["p99_us"] = takes_us[takes_us.size() * 99 / 100];
}

// A take without triangles draws nothing: the sampler only makes the context current and releases it.
void egl_nothing(benchmark::State& state) {
  prepare_software_rendering();
  auto device = make_egl_sampler_device({});
  if (!device) return state.SkipWithError("no EGL context");
  SceneMirror mirror;
  const auto sampler = (*device)->make_sampler();
  std::vector<DepthMap> maps;
  const std::vector<MapRequest> requests(2);
  for (auto _ : state)
    if (!sampler->take(mirror, requests, maps)) return state.SkipWithError("take failed");
}

void embree_take_in_moved(benchmark::State& state) {
  City city;
  EmbreeDevice device;
  EmbreeScene scene(device, EmbreeScene::Content::kOccluders);
  int tick = 0;
  for (auto _ : state) {
    city.walk(++tick);
    scene.take_in(city.mirror);
  }
}

void embree_take_in_static(benchmark::State& state) {
  City city;
  EmbreeDevice device;
  EmbreeScene scene(device, EmbreeScene::Content::kOccluders);
  scene.take_in(city.mirror);
  SceneDelta delta;
  delta.change.push_back({1, {}});
  for (auto _ : state) {
    delta.change[0].attributes.visible = !delta.change[0].attributes.visible;
    if (!city.mirror.apply(delta, {})) std::abort();
    scene.take_in(city.mirror);
  }
}

void maps_and_sizes(benchmark::internal::Benchmark* bench) {
  for (const int maps : {2, 16})
    for (const int resolution : {5, 7, 10, 15, 32}) bench->Args({maps, resolution});
  bench->ArgNames({"maps", "r"})->Unit(benchmark::kMicrosecond)->UseRealTime();
}

BENCHMARK(egl_city)->Apply(maps_and_sizes)->Args({64, 7});
BENCHMARK(egl_growth)
    ->ArgNames({"blocks", "cells"})
    ->Args({20, 3})
    ->Args({20, 8})
    ->Args({20, 25})
    ->Args({6, 8})
    ->Args({63, 8})
    ->Unit(benchmark::kMicrosecond)
    ->UseRealTime();
BENCHMARK(egl_movers)->ArgName("movers")->Arg(10)->Arg(100)->Arg(1000)->Unit(benchmark::kMicrosecond)->UseRealTime();
BENCHMARK(egl_sessions)
    ->ArgNames({"sessions", "together"})
    ->ArgsProduct({{8, 20}, {0, 1}})
    ->Unit(benchmark::kMicrosecond)
    ->UseRealTime();
BENCHMARK(egl_nothing)->Unit(benchmark::kMicrosecond)->UseRealTime();
BENCHMARK(embree_city)->Apply(maps_and_sizes)->Args({64, 16});
BENCHMARK(embree_single_rays)->Apply(maps_and_sizes)->Args({64, 16});
BENCHMARK(embree_take_in_moved)->Unit(benchmark::kMicrosecond)->UseRealTime();
BENCHMARK(embree_take_in_static)->Unit(benchmark::kMicrosecond)->UseRealTime();

}  // namespace
}  // namespace sightline

BENCHMARK_MAIN();
