// Times a step, stage by stage, for each sampler, settings and resolution. tests/bench/step_timing.h says what is
// timed. The column `longest` says how long the longest step takes without interruptions (see kRounds).
//
//   step_bench [--frames N] [--csv FILE]     N steps a row (default: 1200)
//   step_bench --row embree,sightline,7      only this row, for a profiler
//   step_bench --scene level-rooms-parted    another scene of the catalogue
#include <CLI/CLI.hpp>
#include <algorithm>
#include <fstream>
#include <iostream>
#include <limits>
#include <vector>

#include "client/base/text_table.h"
#include "server/gl/software_renderer.h"
#include "tests/bench/step_timing.h"

namespace sightline {
namespace {

// The same steps are taken in each round. An interruption lengthens a step in one round, hardly ever the same step in
// all of them. So the shortest time of each step over the rounds counts, and the longest of these belongs to the
// longest step.
constexpr int kRounds = 3;

struct RowTiming {
  StepTiming steps;         // of the first round
  double longest_ms = 0.0;  // the longest step
};

Result<RowTiming> time_steps(LoadedScene& scene, SamplerDevice& device, const TimedSettings& timed, int r, int frames) {
  RowTiming row;
  std::vector<double> shortest_ms(static_cast<size_t>(frames), std::numeric_limits<double>::infinity());
  for (int round = 0; round < kRounds; ++round) {
    const auto timer = StepTimer::make(scene, device, timed.settings, r, timed_candidates(timed, r));
    if (!timer) return tl::unexpected(timer.error());
    for (int i = -StepTimer::kWarmUpSteps; i < frames; ++i) {
      const auto took_ms = (*timer)->step();
      if (!took_ms) return tl::unexpected(took_ms.error());
      if (i < 0) continue;
      double& shortest = shortest_ms[static_cast<size_t>(i)];
      shortest = std::min(shortest, *took_ms);
    }
    if (round == 0) row.steps = (*timer)->timing();
  }
  row.longest_ms = *std::ranges::max_element(shortest_ms);
  return row;
}

class Tables {
 public:
  explicit Tables(const std::string& csv_path) {
    if (!csv_path.empty()) csv_.open(csv_path);
    csv_ << "sampler,renderer,settings,r,frames,samples,sample_p50_ms,sample_p95_ms,aggregate_p50_ms,"
            "aggregate_p95_ms,"
            "move_p50_ms,move_p95_ms,total_p50_ms,total_p95_ms,total_longest_ms\n";
  }
  void add(const SamplerDevice& device, const TimedSettings& timed, int r, const RowTiming& row) {
    const StepTiming& timing = row.steps;
    csv_ << device.kind() << ",\"" << device.renderer() << "\"," << timed.name << ',' << r << ',' << timing.frames
         << ',' << timing.samples;
    for (const Percentiles& p : {timing.sample, timing.aggregate, timing.move, timing.total})
      csv_ << formatted(",%.4f,%.4f", p.p50_ms, p.p95_ms);
    csv_ << formatted(",%.4f\n", row.longest_ms);
    const auto ms = [](double value) { return formatted("%.3f", value); };
    table_.row({device.kind(), std::string(timed.name), std::to_string(r), std::to_string(timing.samples),
                ms(timing.sample.p50_ms), ms(timing.aggregate.p50_ms), ms(timing.move.p50_ms), ms(timing.total.p50_ms),
                ms(timing.total.p95_ms), ms(row.longest_ms)});
  }
  bool finish() {
    table_.print(std::cout);
    std::cout
        << "\nmilliseconds. The paper (its city; 2012, NVidia FX 3500): r = 5: 1.77 ms, 7: 3.62, 10: 7.83, 15: 24.63\n";
    return !csv_.is_open() || csv_.flush();
  }

 private:
  std::ofstream csv_;
  Table table_{{{"sampler"},
                {"settings"},
                {"r", true},
                {"samples", true},
                {"render", true},
                {"intersect", true},
                {"select", true},
                {"total", true},
                {"p95", true},
                {"longest", true}}};
};

Status run(const std::string& scene_name, int frames, const std::string& only_row, Tables& tables) {
  const auto scene = LoadedScene::load(scene_name);
  if (!scene) return tl::unexpected(scene.error());
  std::string no_egl;
  const auto devices = timed_samplers(&no_egl);
  if (!no_egl.empty()) std::cerr << "no rows for EGL: " << no_egl << '\n';
  for (const auto& device : devices)
    for (const TimedSettings& timed : timed_settings())
      for (const int r : kTimedResolutions) {
        const std::string row = std::string(device->kind()) + ',' + std::string(timed.name) + ',' + std::to_string(r);
        if (timed_candidates(timed, r) == 0 || (!only_row.empty() && row != only_row)) continue;
        const auto timing = time_steps(**scene, *device, timed, r, frames);
        if (!timing) return tl::unexpected(timing.error());
        tables.add(*device, timed, r, *timing);
      }
  return {};
}

}  // namespace
}  // namespace sightline

int main(int argc, char** argv) {
  using namespace sightline;
  prepare_software_rendering();
  CLI::App app("Times steps on a generated scene; on the city, Table 1 of the paper");
  int frames = 1200;
  std::string csv, row, scene = "city";
  app.add_option("--frames", frames, "Steps in each row")->check(CLI::Range(1, 1'000'000))->capture_default_str();
  app.add_option("--csv", csv, "File for the table, with every figure");
  app.add_option("--scene", scene, "Name of a generated scene")->capture_default_str();
  app.add_option("--row", row, "Time only this row: SAMPLER,SETTINGS,R");
  CLI11_PARSE(app, argc, argv);
  Tables tables(csv);
  if (const Status done = run(scene, frames, row, tables); !done)
    return std::cerr << to_string(done.error()) << '\n', 1;
  if (!tables.finish()) return std::cerr << csv << " cannot be written\n", 1;
  return 0;
}
