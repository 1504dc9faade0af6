// What a step costs, stage by stage, on the city (280 K triangles), printed as Table 1 of the paper: two targets, one point
// each, maps of r x r texels, about r^3 candidates, the targets walking.
//
//   step_bench [--benchmark_filter=...] [--benchmark_repetitions=N]
#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <map>
#include <vector>

#include "client/scenario_world.h"
#include "scenes/city.h"
#include "server/gl/software_renderer.h"
#include "server/sample/egl_sampler.h"
#include "server/sample/embree_sampler.h"
#include "server/scene/gltf.h"
#include "server/step.h"

namespace sightline {
namespace {

constexpr double kTickS = 1.0 / 60;

int64_t monotonic_ns() {
  return std::chrono::steady_clock::now().time_since_epoch() / std::chrono::nanoseconds(1);
}

// The city loaded once, shared by all rows.
struct City {
  GeometryStore store;
  EmbreeDevice judge_device;
  std::unique_ptr<Scenario> scenario;

  City() {
    auto asset = read_gltf(scenes::make_city({}), nullptr, store);
    scenario = std::make_unique<Scenario>(*Scenario::from_asset(*asset));
  }
};

struct Percentiles {
  double p50 = 0, p95 = 0;
};
Percentiles percentiles(std::vector<double>& values) {
  std::sort(values.begin(), values.end());
  return {values[values.size() / 2], values[values.size() * 95 / 100]};
}

struct Row {
  size_t samples = 0;
  Percentiles sample, aggregate, move, total;
};
using Table = std::map<std::pair<std::string, int>, Row>;

// Steps through the scenario for as long as the benchmark asks, over and over.
void run_steps(benchmark::State& state, City& city, SamplerDevice& device, Table& table) {
  const int r = static_cast<int>(state.range(0));
  auto world = *ScenarioWorld::make(*city.scenario, city.store, city.judge_device);
  const auto sampler = device.make_sampler();
  StepMemory memory;
  place_camera(memory, city.scenario->camera(), glm::dvec3(0.0));
  const CameraLimits limits;
  StepSettings settings;
  settings.sample.resolution = r;
  settings.aggregate.candidates = r * r * r;
  std::vector<double> sample_ms, aggregate_ms, move_ms, total_ms;
  Row row;
  uint64_t tick = 0;
  for (auto _ : state) {
    state.PauseTiming();
    const uint64_t ticks = static_cast<uint64_t>(city.scenario->duration_s() / kTickS);
    if (tick % ticks == 0) place_camera(memory, city.scenario->camera(), glm::dvec3(0.0));
    world->set_time(static_cast<double>(tick % ticks) * kTickS);
    state.ResumeTiming();
    const int64_t begin = monotonic_ns();
    const StepInput input{world->mirror(), world->targets(), limits, settings, city.scenario->lens(), 1, tick,
                          kTickS};
    const auto result = take_step(memory, input, *sampler, monotonic_ns);
    if (!result) return state.SkipWithError(to_string(result.error()).c_str());
    total_ms.push_back(1e-6 * static_cast<double>(monotonic_ns() - begin));
    const auto ms = [&](Stage stage) {
      return 1e-6 * static_cast<double>(result->stage_ns[static_cast<size_t>(stage)]);
    };
    sample_ms.push_back(ms(Stage::kSample));
    aggregate_ms.push_back(ms(Stage::kAggregate));
    move_ms.push_back(ms(Stage::kMove));
    row.samples = memory.counts.total;
    ++tick;
  }
  row.sample = percentiles(sample_ms), row.aggregate = percentiles(aggregate_ms);
  row.move = percentiles(move_ms), row.total = percentiles(total_ms);
  state.counters["p50_ms"] = row.total.p50;
  state.counters["p95_ms"] = row.total.p95;
  table[{device.kind(), r}] = row;
}

void print_table(const Table& table, const std::vector<std::unique_ptr<SamplerDevice>>& devices) {
  std::printf("\nTable 1 (ms, medians; p95 of the total in brackets; two targets, 280 K triangles)\n");
  for (const auto& device : devices) {
    std::printf("\n%s: %s\n%4s %8s %8s %10s %8s %8s\n", device->kind().c_str(), device->description().c_str(),
                "r", "samples", "render", "intersect", "select", "total");
    for (const auto& [key, row] : table) {
      if (key.first != device->kind()) continue;
      std::printf("%4d %8zu %8.3f %10.3f %8.3f %8.3f  (%.3f)\n", key.second, row.samples, row.sample.p50,
                  row.aggregate.p50, row.move.p50, row.total.p50, row.total.p95);
    }
  }
  std::printf("\nThe paper (2012, NVidia FX 3500): r = 5: 1.77 ms, 7: 3.62, 10: 7.83, 15: 24.63\n");
}

}  // namespace
}  // namespace sightline

int main(int argc, char** argv) {
  using namespace sightline;
  prepare_software_rendering();
  benchmark::Initialize(&argc, argv);
  City city;
  std::vector<std::unique_ptr<SamplerDevice>> devices;
  if (auto egl = make_egl_sampler_device({}))
    devices.push_back(std::move(*egl));
  else
    std::fprintf(stderr, "EGL rows left out: %s\n", to_string(egl.error()).c_str());
  devices.push_back(make_embree_sampler_device());
  Table table;
  for (const auto& device : devices) {
    SamplerDevice* const used = device.get();
    benchmark::RegisterBenchmark(
        ("step/" + used->kind()).c_str(),
        [&city, &table, used](benchmark::State& state) { run_steps(state, city, *used, table); })
        ->Arg(5)
        ->Arg(7)
        ->Arg(10)
        ->Arg(15)
        ->ArgName("r")
        ->Unit(benchmark::kMillisecond)
        ->Iterations(1200);
  }
  benchmark::RunSpecifiedBenchmarks();
  print_table(table, devices);
}
