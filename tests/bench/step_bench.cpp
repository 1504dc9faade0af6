// What a step costs, stage by stage, on the city (280 K triangles), printed as Table 1 of the paper: see client/evaluate/step_timing.h.
//
//   step_bench [--benchmark_filter=...] [--benchmark_repetitions=N]
#include <benchmark/benchmark.h>

#include <cstdio>
#include <map>
#include <tuple>

#include "client/evaluate/step_timing.h"
#include "server/gl/software_renderer.h"

namespace sightline {
namespace {

using Table = std::map<std::tuple<std::string, std::string, int>, StepTiming>;  // by sampler, settings, r

void run_steps(benchmark::State& state, TimedCity& city, SamplerDevice& device, const TimedSettings& timed,
               Table& table) {
  const int r = static_cast<int>(state.range(0));
  const auto timer = StepTimer::make(city, device, timed.settings, r);
  if (!timer) return state.SkipWithError(to_string(timer.error()).c_str());
  for (int i = 0; i < StepTimer::kWarmUpSteps; ++i)
    if (const auto took_ms = (*timer)->step(); !took_ms)
      return state.SkipWithError(to_string(took_ms.error()).c_str());
  for (auto _ : state) {
    const auto took_ms = (*timer)->step();
    if (!took_ms) return state.SkipWithError(to_string(took_ms.error()).c_str());
    state.SetIterationTime(1e-3 * *took_ms);
  }
  const StepTiming timing = (*timer)->timing();
  state.counters["p50_ms"] = timing.total.p50_ms;
  state.counters["p95_ms"] = timing.total.p95_ms;
  table[{device.kind(), std::string(timed.name), r}] = timing;
}

void print_table(const Table& table, const std::vector<std::unique_ptr<SamplerDevice>>& devices) {
  std::printf("\nTable 1 (ms, medians; p95 of the total in brackets; two targets, 280 K triangles)\n");
  for (const auto& device : devices) {
    std::printf("\n%s: %s\n%-10s %4s %8s %8s %10s %8s %8s\n", device->kind().c_str(),
                device->renderer().c_str(), "settings", "r", "samples", "render", "intersect", "select",
                "total");
    for (const auto& [key, row] : table) {
      const auto& [kind, settings, r] = key;
      if (kind != device->kind()) continue;
      std::printf("%-10s %4d %8zu %8.3f %10.3f %8.3f %8.3f  (%.3f)\n", settings.c_str(), r, row.samples,
                  row.sample.p50_ms, row.aggregate.p50_ms, row.move.p50_ms, row.total.p50_ms,
                  row.total.p95_ms);
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
  const auto city = TimedCity::load();
  if (!city) return std::fprintf(stderr, "%s\n", to_string(city.error()).c_str()), 1;
  std::string no_egl;
  const auto devices = timed_samplers(&no_egl);
  if (!no_egl.empty()) std::fprintf(stderr, "EGL rows left out: %s\n", no_egl.c_str());
  Table table;
  for (const auto& device : devices)
    for (const TimedSettings& timed : timed_settings()) {
      auto* const row = benchmark::RegisterBenchmark(
          ("step/" + device->kind()).append("/").append(timed.name).c_str(),
          [&, timed](benchmark::State& state) { run_steps(state, **city, *device, timed, table); });
      for (const int r : kTimedResolutions) row->Arg(r);
      row->ArgName("r")->Unit(benchmark::kMillisecond)->UseManualTime()->Iterations(1200);
    }
  benchmark::RunSpecifiedBenchmarks();
  print_table(table, devices);
}
