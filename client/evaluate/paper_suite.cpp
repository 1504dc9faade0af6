#include "client/evaluate/paper_suite.h"

#include <array>

#include "client/evaluate/policy_step.h"
#include "server/step/paper_settings.h"

namespace sightline {
namespace {

template <Strategy strategy, int prediction_ms>
StepSettings row_settings() {
  return paper_row(strategy, 0.001 * prediction_ms);
}
template <Strategy strategy, int prediction_ms>
constexpr auto kMakeRow = &make_step<row_settings<strategy, prediction_ms>>;

template <int a, int n>
StepSettings stability_settings() {
  return paper_stability(a, n);
}
template <int a, int n>
constexpr auto kMakeStability = &make_step<stability_settings<a, n>>;

constexpr std::array<PolicyEntry, 8> kModels{{
    {"Basic", "the nearest place", kMakeRow<Strategy::kBasic, 0>},
    {"RobustMove", "the middle of the largest group", kMakeRow<Strategy::kRobust, 0>},
    {"Basic+Pred. 100", "predicted 0.1 s ahead", kMakeRow<Strategy::kBasic, 100>},
    {"Basic+Pred. 300", "predicted 0.3 s ahead", kMakeRow<Strategy::kBasic, 300>},
    {"Basic+Pred. 500", "predicted 0.5 s ahead", kMakeRow<Strategy::kBasic, 500>},
    {"RobustMove+Pred. 100", "predicted 0.1 s ahead", kMakeRow<Strategy::kRobust, 100>},
    {"RobustMove+Pred. 300", "predicted 0.3 s ahead", kMakeRow<Strategy::kRobust, 300>},
    {"RobustMove+Pred. 500", "predicted 0.5 s ahead", kMakeRow<Strategy::kRobust, 500>},
}};

constexpr std::array<PolicyEntry, 4> kStabilities{{
    {"0/0", "no filter", kMakeStability<0, 0>},
    {"3/5", "3 of the last 5 steps", kMakeStability<3, 5>},
    {"6/10", "6 of the last 10 steps", kMakeStability<6, 10>},
    {"8/15", "8 of the last 15 steps", kMakeStability<8, 15>},
}};

constexpr std::array<PaperTiming, 4> kPaperTimings{{
    {5, 75, 0.70, 0.91, 0.16, 1.77},
    {7, 343, 0.80, 2.10, 0.72, 3.62},
    {10, 1000, 0.80, 5.20, 1.81, 7.83},
    {15, 3375, 1.00, 19.30, 4.28, 24.63},
}};

template <typename Row>
std::vector<const PolicyEntry*> policies_of(const std::vector<Row>& rows) {
  std::vector<const PolicyEntry*> chosen;
  for (const Row& row : rows) chosen.push_back(row.policy);
  return chosen;
}

Result<StepTiming> time_steps(TimedCity& city, SamplerDevice& device, const StepSettings& settings, int r,
                              int frames, const std::function<void(double)>& progress) {
  const auto timer = StepTimer::make(city, device, settings, r);
  if (!timer) return tl::unexpected(timer.error());
  for (int i = 0; i < StepTimer::kWarmUpSteps + frames; ++i) {
    if (const auto took_ms = (*timer)->step(); !took_ms) return tl::unexpected(took_ms.error());
    progress(static_cast<double>(i) / (StepTimer::kWarmUpSteps + frames));
  }
  return (*timer)->timing();
}

Status time_all(const PaperOptions& options, PaperResults& results) {
  const auto city = TimedCity::load();
  if (!city) return tl::unexpected(city.error());
  const auto devices = timed_samplers(&results.no_egl);
  const std::vector<TimedSettings> settings = timed_settings();
  const size_t rows = devices.size() * settings.size() * std::size(kTimedResolutions);
  const auto progress = [&](double row_share) {
    const double done = static_cast<double>(results.timings.size()) + row_share;
    if (options.progress) options.progress("Table 1", done / static_cast<double>(rows));
  };
  for (const auto& device : devices)
    for (const TimedSettings& timed : settings)
      for (const int r : kTimedResolutions) {
        const auto timing = time_steps(**city, *device, timed.settings, r, options.timed_frames, progress);
        if (!timing) return tl::unexpected(timing.error());
        results.timings.push_back(
            {device->kind(), device->renderer(), std::string(timed.name), r, *timing});
      }
  return {};
}

template <typename Row>
Result<Evaluation> play(std::string_view table, std::span<const SceneCase> cases,
                        const std::vector<Row>& rows, const PaperOptions& options) {
  EvaluationOptions playing = options.playing;
  playing.progress = [&](double share) {
    if (options.progress) options.progress(table, share);
  };
  return evaluate(cases, policies_of(rows), playing);
}

}  // namespace

std::vector<ModelRow> model_rows() {
  std::vector<ModelRow> rows{
      {&kModels[0], "Basic", 0, PaperShares{0.1232, 0.0841}},
      {&kModels[1], "RobustMove", 0, PaperShares{0.0747, 0.0712}},
      {&kModels[2], "Basic", 100, PaperShares{0.0332, 0.0940}},
      {&kModels[3], "Basic", 300, PaperShares{0.0112, 0.0633}},
      {&kModels[4], "Basic", 500, PaperShares{0.0502, 0.0971}},
      {&kModels[5], "RobustMove", 100, PaperShares{0.0059, 0.0308}},
      {&kModels[6], "RobustMove", 300, PaperShares{0.0000, 0.0228}},
      {&kModels[7], "RobustMove", 500, PaperShares{0.0141, 0.0589}},
  };
  for (const std::string_view name : {"sightline", "follow", "spring-arm", "raycast"})
    rows.push_back({find_policy(name), name, std::nullopt, std::nullopt});
  return rows;
}

std::vector<StabilityRow> stability_rows() {
  return {{&kStabilities[0], PaperStability{2.69, 157.0, 1.7}},
          {&kStabilities[1], PaperStability{2.75, 38.4, 1.2}},
          {&kStabilities[2], PaperStability{2.87, 4.1, 0.1}},
          {&kStabilities[3], PaperStability{2.91, 0.4, 0.1}},
          {find_policy("sightline"), std::nullopt}};
}

const PaperTiming* paper_timing(int resolution) {
  for (const PaperTiming& row : kPaperTimings)
    if (row.resolution == resolution) return &row;
  return nullptr;
}

Result<PaperResults> play_paper(const PaperCases& cases, const PaperOptions& options) {
  PaperResults results;
  // First, while nothing else runs.
  if (auto timed = time_all(options, results); !timed) return tl::unexpected(timed.error());
  auto hall = play("Table 2", cases.hall, model_rows(), options);
  if (!hall) return tl::unexpected(hall.error());
  results.hall = std::move(*hall);
  auto fence = play("Table 3", cases.fence, stability_rows(), options);
  if (!fence) return tl::unexpected(fence.error());
  results.fence = std::move(*fence);
  return results;
}

}  // namespace sightline
