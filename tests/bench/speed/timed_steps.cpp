#include "tests/bench/speed/timed_steps.h"

#include <algorithm>
#include <chrono>
#include <cstdlib>

namespace sightline::bench {
namespace {

constexpr double kTickS = 1.0 / 60;
constexpr size_t kBlocks = 10;

int64_t now_ns() {
  return std::chrono::steady_clock::now().time_since_epoch() / std::chrono::nanoseconds(1);
}

double quantile(std::vector<double> values, double q) {
  if (values.empty()) return 0;
  const auto rank = static_cast<ptrdiff_t>(q * static_cast<double>(values.size() - 1) + 0.5);
  std::nth_element(values.begin(), values.begin() + rank, values.end());
  return values[static_cast<size_t>(rank)];
}

double median_of_block(const std::vector<double>& values, size_t block) {
  const size_t first = block * values.size() / kBlocks, end = (block + 1) * values.size() / kBlocks;
  return quantile({values.begin() + static_cast<ptrdiff_t>(first), values.begin() + static_cast<ptrdiff_t>(end)}, 0.5);
}

std::string share_text(double share) {
  return share < 0 ? "" : std::to_string(share);
}

}  // namespace

double now_ms() {
  return 1e-6 * static_cast<double>(now_ns());
}

TimedSteps::TimedSteps(std::string name, const TimedScene& scene, const StepSettings& settings, SamplerDevice& device)
    : scene_(scene), settings_(settings), sampler_(device.make_sampler()) {
  track_.name = std::move(name);
  if (const Status ok = validate(settings_); !ok)
    std::fprintf(stderr, "%s\n", to_string(ok.error()).c_str()), std::abort();
}

void TimedSteps::step(double scene_ms) {
  const StepInput input{
      scene_.mirror, scene_.targets, limits_, settings_, scene_.lens, 1, static_cast<uint64_t>(frame_),
      kTickS,        scene_.tables};
  const double begin_ms = now_ms();
  const auto result = stepper_.take(input, *sampler_, now_ns);
  const double total_ms = now_ms() - begin_ms;
  if (!result) std::fprintf(stderr, "%s\n", to_string(result.error()).c_str()), std::abort();
  if (frame_++ < kWarmUpFrames) return;
  const auto stage_ms = [&](Stage stage) {
    return 1e-6 * static_cast<double>(result->stage_ns[static_cast<size_t>(stage)]);
  };
  track_.total_ms.push_back(total_ms);
  track_.sample_ms.push_back(stage_ms(Stage::kSample));
  track_.aggregate_ms.push_back(stage_ms(Stage::kAggregate));
  track_.move_ms.push_back(stage_ms(Stage::kMove));
  track_.scene_ms.push_back(scene_ms);
  track_.candidates = stepper_.dump().sights.candidates.size();
}

bool Tables::open(const std::string& folder) {
  rows_ = std::fopen((folder + "/rows.csv").c_str(), "w");
  ratios_ = std::fopen((folder + "/ratios.csv").c_str(), "w");
  if (!rows_ || !ratios_) return false;
  std::fprintf(rows_,
               "section,x,row,frames,candidates,p50_ms,p5_ms,p95_ms,p99_ms,scene_p50_ms,sample_p50_ms,"
               "aggregate_p50_ms,move_p50_ms,agreement,agreement_on_rays\n");
  std::fprintf(ratios_, "section,x,ours,other,ratio,least,greatest\n");
  return true;
}

Tables::~Tables() {
  if (rows_) std::fclose(rows_);
  if (ratios_) std::fclose(ratios_);
}

void Tables::row(const std::string& section, double x, const Track& t) {
  const double p50 = quantile(t.total_ms, 0.5), p95 = quantile(t.total_ms, 0.95);
  std::fprintf(rows_, "%s,%.0f,%s,%zu,%zu,%.4f,%.4f,%.4f,%.4f,%.4f,%.4f,%.4f,%.4f,%s,%s\n", section.c_str(), x,
               t.name.c_str(), t.total_ms.size(), t.candidates, p50, quantile(t.total_ms, 0.05), p95,
               quantile(t.total_ms, 0.99), quantile(t.scene_ms, 0.5), quantile(t.sample_ms, 0.5),
               quantile(t.aggregate_ms, 0.5), quantile(t.move_ms, 0.5), share_text(t.agreement).c_str(),
               share_text(t.agreement_on_rays).c_str());
  std::fflush(rows_);
  std::printf("%-18s %10.0f  %-22s p50 %9.4f ms  p95 %9.4f\n", section.c_str(), x, t.name.c_str(), p50, p95);
  std::fflush(stdout);
}

void Tables::ratio(const std::string& section, double x, const Track& ours, const Track& other) {
  std::vector<double> ratios;
  for (size_t block = 0; block < kBlocks; ++block)
    ratios.push_back(median_of_block(other.total_ms, block) / median_of_block(ours.total_ms, block));
  std::fprintf(ratios_, "%s,%.0f,%s,%s,%.3f,%.3f,%.3f\n", section.c_str(), x, ours.name.c_str(), other.name.c_str(),
               quantile(ratios, 0.5), quantile(ratios, 0.0), quantile(ratios, 1.0));
  std::fflush(ratios_);
}

}  // namespace sightline::bench
