// The paper's own evaluation, played by this implementation: what `sightline evaluate --suite paper` does.
//
//   Table 1  what a step costs                 on the city, one thread at a time
//   Table 2  strategies and predictions        on the hall, each seed
//   Table 3  stability by a filter over time   on the fence, each seed; reaction on the fence with a board
//
// Beside the paper's rows stand the default (preset sightline) and, in Table 2, the baselines. Everything but times is a
// pure function of scenes and options, whatever the number of jobs.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "client/evaluate/evaluation.h"
#include "tests/bench/step_timing.h"

namespace sightline {

struct PaperCases {
  std::vector<SceneCase> hall;
  std::vector<SceneCase> fence;  // with and without the board
};

struct PaperOptions {
  int timed_frames = 5000;    // >= 1; of each row of Table 1, as in the paper
  EvaluationOptions playing;  // of Tables 2 and 3; its progress is not called
  // Which table, and how much of it is done, in [0, 1]; one call at a time, on any thread.
  std::function<void(std::string_view table, double share)> progress;
};

struct TimingRow {
  std::string sampler;   // "egl" or "embree"
  std::string renderer;  // of the sampler
  std::string settings;  // see timed_settings
  int resolution = 0;    // r
  StepTiming timing;
};

struct PaperResults {
  std::string no_egl;  // why Table 1 has no rows of EGL; empty when it has
  std::vector<TimingRow> timings;
  Evaluation hall, fence;
};

// Fails as `evaluate` does, and when the city cannot be loaded or a sampler fails.
Result<PaperResults> play_paper(const PaperCases& cases, const PaperOptions& options);

// A row of Table 2: how the camera moves, and the paper's shares of frames where it has the row.
struct PaperShares {
  double r_n = 0.0, r_p = 0.0;
};
struct ModelRow {
  const PolicyEntry* policy = nullptr;
  std::string_view model;  // without the prediction
  std::optional<int> prediction_ms;
  std::optional<PaperShares> paper;
};
std::vector<ModelRow> model_rows();

// A row of Table 3; distances are in the paper's own units, which it does not name.
struct PaperStability {
  double t_c_ms = 0.0, d_c = 0.0, d_s = 0.0;
};
struct StabilityRow {
  const PolicyEntry* policy = nullptr;
  std::optional<PaperStability> paper;
};
// The first is without any filter: what the others are compared with.
std::vector<StabilityRow> stability_rows();

// A row of Table 1 as printed.
struct PaperTiming {
  int resolution = 0, samples = 0;
  double render_ms = 0.0, intersect_ms = 0.0, select_ms = 0.0, total_ms = 0.0;
};
// Null for another resolution.
const PaperTiming* paper_timing(int resolution);

}  // namespace sightline
