// What Embree's part costs as a scene grows: the step's maps with 0 to 1,000 of 10,000 instances moving, the bytes of a
// further session, and the bytes and build time of large meshes.
#include <benchmark/benchmark.h>
#include <malloc.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>
#include <memory>
#include <vector>

#include "server/base/random.h"
#include "server/sample/embree_sampler.h"
#include "server/sample/embree_scene.h"
#include "server/sample/plan.h"
#include "tests/bench/speed/grid_city.h"

namespace sightline {
namespace {

using bench::GridCity;
using bench::GridCityOptions;

constexpr double kAheadS = 0.5;

double thread_us() {
  timespec now;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e6 * static_cast<double>(now.tv_sec) + 1e-3 * static_cast<double>(now.tv_nsec);
}

// What a step of two targets with 8 points asks for: maps of 7 x 7 around a ball behind the targets, three a target ahead, and
// a sight a point.
std::vector<MapRequest> step_requests(const GridCity& city, std::vector<uint32_t>& slots) {
  slots.clear();
  for (const Target& target : city.targets()) slots.push_back(*city.mirror().slot_of(target.instance_id));
  const Bound bound{.center_m = city.camera().position_m, .radius_m = 1.5};
  CounterRandom random(3, 0, RandomPurpose::kTexelJitter);
  std::vector<MapRequest> requests;
  for (size_t t = 0; t < slots.size(); ++t)
    for (int point = 0; point < 8; ++point) {
      const glm::dvec3 eye_m = city.mirror().instances()[slots[t]].center_m +
                               glm::dvec3(random.next_in(-0.3, 0.3), random.next_in(-0.8, 0.8), random.next_in(-0.3, 0.3));
      std::vector<MapView> views;
      plan_views(eye_m, bound, {.resolution = 7}, {random.next_unit(), random.next_unit()}, views);
      views.push_back(plan_sight(eye_m, bound.center_m));
      const double far_m = 1.01 * (glm::distance(eye_m, bound.center_m) + bound.radius_m);
      for (const MapView& view : views)
        requests.push_back({.view = view, .far_m = far_m, .ignored_slots = std::span(&slots[t], 1)});
      if (point < 3) requests.push_back(requests[requests.size() - 2]), requests.back().ahead_s = kAheadS;
    }
  return requests;
}

void movers(benchmark::State& state) {
  GridCity city(GridCityOptions{.movers = static_cast<int>(state.range(0)),
                                .props = 9600 - static_cast<int>(state.range(0))});
  const auto device = make_embree_sampler_device();
  const auto sampler = device->make_sampler();
  std::vector<uint32_t> slots;
  std::vector<DepthMap> maps;
  std::vector<double> takes_us;
  int tick = 0;
  for (auto _ : state) {
    city.advance(++tick);
    const auto requests = step_requests(city, slots);
    const double start_us = thread_us();
    if (!sampler->take(city.mirror(), requests, maps)) return state.SkipWithError("take failed");
    takes_us.push_back(thread_us() - start_us);
  }
  std::sort(takes_us.begin(), takes_us.end());
  state.counters["take_p50_us"] = takes_us[takes_us.size() / 2];
  state.counters["maps"] = static_cast<double>(maps.size());
  state.counters["instances"] = static_cast<double>(city.mirror().size());
}

// A copy of the scene under a mirror of its own, as a session holds it.
void copy_scene(const SceneMirror& from, SceneMirror& to) {
  SceneDelta delta;
  delta.asset_ids_allowed = true;
  for (const Instance& i : from.instances())
    if (i.geometry)
      delta.add.push_back({.id = i.id, .geometry = i.geometry, .pose = i.pose, .linear = i.linear,
                           .attributes = i.attributes, .moving = i.moving});
  if (!to.apply(delta, {})) std::abort();
}

double heap_bytes() {
  malloc_trim(0);
  const struct mallinfo2 info = mallinfo2();
  return static_cast<double>(info.uordblks + info.hblkhd);
}

void further_session(benchmark::State& state) {
  constexpr int kSessions = 20;
  GridCity city(GridCityOptions{.movers = 50, .props = 9550});
  const auto device = make_embree_sampler_device();
  std::vector<uint32_t> slots;
  const auto requests = step_requests(city, slots);
  std::vector<DepthMap> maps;
  const auto first = device->make_sampler();
  if (!first->take(city.mirror(), requests, maps)) return state.SkipWithError("take failed");
  for (auto _ : state) {
    std::vector<SceneMirror> mirrors(kSessions);
    std::vector<std::unique_ptr<Sampler>> samplers;
    const double before = heap_bytes(), embree_before = static_cast<double>(device->geometry_bytes());
    for (SceneMirror& mirror : mirrors) copy_scene(city.mirror(), mirror);
    const double with_mirrors = heap_bytes();
    for (SceneMirror& mirror : mirrors) {
      samplers.push_back(device->make_sampler());
      if (!samplers.back()->take(mirror, requests, maps)) return state.SkipWithError("take failed");
    }
    state.counters["mirror_kib"] = (with_mirrors - before) / kSessions / 1024;
    state.counters["sampler_kib"] = (heap_bytes() - with_mirrors) / kSessions / 1024;
    state.counters["embree_kib"] = (static_cast<double>(device->geometry_bytes()) - embree_before) / kSessions / 1024;
  }
}

// A rolling field of 2 n^2 triangles.
MeshData field(uint32_t n) {
  MeshData mesh;
  for (uint32_t y = 0; y <= n; ++y)
    for (uint32_t x = 0; x <= n; ++x)
      mesh.positions.emplace_back(0.1 * x, 5 * std::sin(0.013 * x) * std::cos(0.017 * y), 0.1 * y);
  for (uint32_t y = 0; y < n; ++y)
    for (uint32_t x = 0; x < n; ++x) {
      const uint32_t a = y * (n + 1) + x, b = a + n + 1;
      mesh.indices.insert(mesh.indices.end(), {a, a + 1, b + 1, a, b + 1, b});
    }
  return mesh;
}

void report_bytes(benchmark::State& state, const SceneMirror& mirror) {
  size_t triangles = 0, source = 0;
  std::vector<const Geometry*> seen;
  for (const Instance& instance : mirror.instances()) {
    const Geometry* geometry = instance.geometry.get();
    if (!geometry || std::find(seen.begin(), seen.end(), geometry) != seen.end()) continue;
    seen.push_back(geometry);
    triangles += geometry->triangle_count();
    source += geometry->bytes();
  }
  for (auto _ : state) {
    EmbreeDevice device;
    EmbreeScene scene(device, EmbreeScene::Content::kOccluders);
    scene.take_in(mirror);
    const double each = 1.0 / static_cast<double>(triangles);
    state.counters["triangles"] = static_cast<double>(triangles);
    state.counters["geometry_B"] = each * static_cast<double>(source);
    state.counters["embree_B"] = each * static_cast<double>(device.geometry_bytes());
  }
}

void build_city(benchmark::State& state) {
  report_bytes(state, GridCity(GridCityOptions{}).mirror());
}

void build_field(benchmark::State& state) {
  SceneMirror mirror;
  SceneDelta delta;
  const auto n = static_cast<uint32_t>(std::lround(std::sqrt(static_cast<double>(state.range(0)) / 2)));
  delta.add.push_back({.id = 1, .geometry = build_geometry(field(n)).value(), .pose = {}, .attributes = {}});
  if (!mirror.apply(delta, {})) std::abort();
  report_bytes(state, mirror);
}

BENCHMARK(movers)->ArgName("moving")->Arg(0)->Arg(100)->Arg(1000)->Unit(benchmark::kMicrosecond)->MinTime(0.5);
BENCHMARK(further_session)->Iterations(1)->Unit(benchmark::kMillisecond);
BENCHMARK(build_city)->Iterations(3)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(build_field)->ArgName("triangles")->Arg(280'000)->Arg(10'000'000)->Iterations(1)->Unit(benchmark::kMillisecond)->UseRealTime();

}  // namespace
}  // namespace sightline

BENCHMARK_MAIN();
