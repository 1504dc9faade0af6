// Measures the cost of the temporal volume in a step (paper 5): pushing every cell of a lattice and filtering it. Rows
// vary the mode, the number of candidates, the window and the targets. The time must follow the candidates and not the
// window: O(g^3), not O(n g^3). `plain` computes the paper's sum over n steps directly. It does less (no gaps, no
// shares, no switches; two targets), so compare how the two grow with n. `pairs` filters over pair volumes, whose
// candidates differ from step to step: the time follows candidates times window, O(n g^3).
#include <benchmark/benchmark.h>

#include <array>
#include <vector>

#include "server/aggregate/temporal_volume.h"
#include "server/base/random.h"
#include "server/paper/pair_history.h"
#include "tests/aggregate/random_ball.h"

namespace sightline {
namespace {

constexpr double kDt = 1.0 / 60;
constexpr int kRound = 97;  // steps of made-up visibility, used in turn

// Runs of 1 to 8 steps, cell by cell, so that all states of a few targets occur in every window.
std::vector<std::vector<uint32_t>> made_up(size_t cells, int targets) {
  std::vector<std::vector<uint32_t>> steps(kRound, std::vector<uint32_t>(cells));
  CounterRandom random(1, static_cast<uint64_t>(targets), RandomPurpose::kTest);
  for (size_t i = 0; i < cells; ++i)
    for (int t = 0; t < targets; ++t)
      for (int s = 0; s < kRound;) {
        const uint32_t seen = random.next_below(2), run = 1 + random.next_below(8);
        for (uint32_t k = 0; k < run && s < kRound; ++k, ++s) steps[s][i] |= seen << t;
      }
  return steps;
}

Lattice covered(int candidates) {
  Bound bound;
  bound.radius_m = 1.25;
  Lattice lattice;
  lattice.cover(bound, candidates);
  return lattice;
}

std::vector<uint64_t> ids(int targets) {
  std::vector<uint64_t> out;
  for (int i = 0; i < targets; ++i) out.push_back(1 + i);
  return out;
}

void report(benchmark::State& state, size_t cells) {
  state.counters["cells"] = static_cast<double>(cells);
  state.counters["a_cell"] = benchmark::Counter(
      static_cast<double>(cells), benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}

void run(benchmark::State& state, const FilterSettings& settings) {
  const int targets = static_cast<int>(state.range(2));
  const Lattice lattice = covered(static_cast<int>(state.range(0)));
  const auto steps = made_up(lattice.addresses().size(), targets);
  const auto target_ids = ids(targets);
  TemporalVolume volume;
  std::vector<uint32_t> out;
  int step = 0;
  for (auto _ : state) {
    const auto& visible = steps[step++ % kRound];
    volume.begin_step(lattice, 0, target_ids, settings, kDt);
    volume.push(lattice, visible);
    volume.filter(lattice.addresses(), visible, 0xFFFFFFFF, out);
    benchmark::DoNotOptimize(out.data());
  }
  report(state, lattice.addresses().size());
}

void joint(benchmark::State& state) {
  FilterSettings settings;
  settings.mode = FilterMode::kJoint;
  settings.n = static_cast<int>(state.range(1));
  run(state, settings);
}

void per_target(benchmark::State& state) {
  FilterSettings settings;
  settings.window_s = static_cast<double>(state.range(1)) * kDt;
  run(state, settings);
}

// Two targets: the last n states of a cell in a ring, summed again in every step.
void plain(benchmark::State& state) {
  const Lattice lattice = covered(static_cast<int>(state.range(0)));
  const size_t cells = lattice.addresses().size();
  const auto n = static_cast<size_t>(state.range(1));
  const auto steps = made_up(cells, 2);
  std::vector<uint8_t> ring(cells * n);
  std::vector<uint32_t> out(cells);
  size_t step = 0;
  for (auto _ : state) {
    const auto& visible = steps[step % kRound];
    for (size_t i = 0; i < cells; ++i) {
      ring[i * n + step % n] = static_cast<uint8_t>(visible[i]);
      std::array<uint32_t, 4> count{};
      for (size_t k = 0; k < n; ++k) ++count[ring[i * n + k]];
      out[i] = 0;
      for (uint32_t v = 1; v < 4; ++v)
        if (count[v] >= 0.6 * static_cast<double>(n)) out[i] = v;
    }
    ++step;
    benchmark::DoNotOptimize(out.data());
  }
  report(state, cells);
}

// One step of a moving camera over a pair volume, with made-up depths.
struct PairStep {
  PairChain chain;
  std::vector<DepthMap> maps;
  CandidateSet candidates;
};

PairStep pair_step(CounterRandom& random, const glm::dvec3& camera_m, int r) {
  const std::vector<glm::dvec3> targets_m{{-0.8, 0, 0}, {0.8, 0.2, 0}};
  const Bound bound = ball(camera_m, 0.83);
  PairStep step;
  if (make_pair_chain(targets_m, bound, r, glm::dvec2(0.5), step.chain) != PairGap::kNone) std::abort();
  const auto texels = static_cast<size_t>(r * r);
  for (uint32_t i = 0; i < 2; ++i) {
    DepthMap map{chain_view(step.chain, i, glm::dvec2(0.5)), std::vector<float>(texels),
                 std::vector<uint32_t>(texels, 0)};
    const double away_m = glm::distance(targets_m[i], camera_m);
    for (float& distance_m : map.distance_m)
      distance_m = static_cast<float>(random.next_in(0.7 * away_m, 1.4 * away_m));
    step.maps.push_back(std::move(map));
  }
  std::vector<glm::ivec3> texels_of_candidates;
  compose_chain(step.chain, step.maps, bound, 0.001, step.candidates, texels_of_candidates);
  return step;
}

void pairs(benchmark::State& state) {
  CounterRandom random(1, 0, RandomPurpose::kTest);
  std::vector<PairStep> steps;
  glm::dvec3 camera_m(0, 0.5, 6);
  for (int k = 0; k < kRound; ++k)
    steps.push_back(pair_step(random, camera_m, static_cast<int>(state.range(0)))), camera_m.x += 0.02;
  FilterSettings settings;
  settings.mode = FilterMode::kJoint;
  settings.n = static_cast<int>(state.range(1));
  const auto target_ids = ids(2);
  PairHistory history;
  std::vector<uint32_t> out;
  size_t step = 0, candidates = 0;
  for (auto _ : state) {
    const PairStep& now = steps[step++ % kRound];
    history.push(now.chain, now.maps, target_ids, 0.001, settings.n);
    history.filter(now.candidates.position_m.view().singles_m(), now.candidates.visible_targets, target_ids, 3,
                   settings, out);
    candidates += now.candidates.size();
    benchmark::DoNotOptimize(out.data());
  }
  report(state, candidates / std::max<size_t>(step, 1));
}

BENCHMARK(pairs)->ArgNames({"r", "n"})->ArgsProduct({{7, 15}, {1, 5, 10, 15, 30, 60}});
BENCHMARK(joint)->ArgNames({"candidates", "n", "targets"})->ArgsProduct({{343, 4096}, {5, 10, 15, 32, 64}, {2}});
BENCHMARK(joint)->ArgNames({"candidates", "n", "targets"})->ArgsProduct({{343}, {10, 64}, {3, 8, 32}});
BENCHMARK(per_target)->ArgNames({"candidates", "n", "targets"})->ArgsProduct({{343, 4096}, {5, 15, 60}, {2}});
BENCHMARK(per_target)->ArgNames({"candidates", "n", "targets"})->ArgsProduct({{343}, {15}, {8, 32}});
BENCHMARK(plain)->ArgNames({"candidates", "n", "targets"})->ArgsProduct({{343, 4096}, {5, 10, 15, 32, 64}, {2}});

}  // namespace
}  // namespace sightline

BENCHMARK_MAIN();
