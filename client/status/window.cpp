#include "client/status/window.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace sightline {
namespace {

uint64_t count_of(const v1::DurationHistogram& histogram) {
  return std::accumulate(histogram.counts().begin(), histogram.counts().end(), uint64_t{0});
}

double ratio(double part, double whole) {
  return whole > 0.0 ? part / whole : 0.0;
}

DurationRow row(std::string name, const v1::DurationHistogram& later, const v1::DurationHistogram& earlier) {
  const v1::DurationHistogram within = difference(later, earlier);
  const uint64_t count = count_of(within);
  return {.name = std::move(name),
          .count = count,
          .p50_us = quantile_us(within, 0.5),
          .p99_us = quantile_us(within, 0.99),
          .mean_us = ratio(within.sum_s() * 1e6, static_cast<double>(count))};
}

const v1::DurationHistogram& stage_of(const v1::GetServerStatsResponse& stats, const std::string& name) {
  for (const v1::StageHistogram& stage : stats.stages())
    if (stage.stage() == name) return stage.durations();
  return v1::DurationHistogram::default_instance();
}

double blind_s(const v1::CameraFigures& figures) {
  return figures.seeking_s() + figures.blocked_s() + figures.waiting_s() + figures.lost_s();
}

}  // namespace

CameraShares camera_shares(const v1::CameraFigures& earlier, const v1::CameraFigures& later) {
  const auto within = [&](auto of) { return std::max(0.0, of(later) - of(earlier)); };
  using Figures = v1::CameraFigures;
  const double tracking_s = within([](const Figures& f) { return f.tracking_s(); });
  const double partial_s = within([](const Figures& f) { return f.partial_view_s(); });
  const double unseen_s = within(blind_s), shot_s = within([](const Figures&f) { return f.shot_s(); });
  CameraShares shares;
  shares.seconds = tracking_s + partial_s + unseen_s;
  shares.tracking = ratio(tracking_s, shares.seconds);
  shares.partial = ratio(partial_s, shares.seconds);
  shares.blind = ratio(unseen_s, shares.seconds);
  shares.target_seconds = within([](const Figures& f) { return f.target_s(); });
  shares.shown = ratio(within([](const Figures& f) { return f.shown_s(); }), shares.target_seconds);
  shares.shot_seconds = shot_s;
  shares.worth = ratio(within([](const Figures& f) { return f.worth_s(); }), shot_s);
  shares.shot_kept = ratio(within([](const Figures& f) { return f.shot_kept_s(); }), shot_s);
  shares.cuts = later.cuts() - std::min(earlier.cuts(), later.cuts());
  return shares;
}

double quantile_us(const v1::DurationHistogram& histogram, double q) {
  const auto all = static_cast<double>(count_of(histogram));
  if (all == 0.0) return 0.0;
  const double wanted = std::clamp(q, 0.0, 1.0) * all;
  double below = 0.0;
  for (int k = 0; k < histogram.counts_size(); ++k) {
    const auto count = static_cast<double>(histogram.counts(k));
    const double end = std::exp2(k), begin = k == 0 ? 0.0 : end / 2.0;
    if (count > 0.0 && below + count >= wanted) return begin + (end - begin) * (wanted - below) / count;
    below += count;
  }
  return std::exp2(histogram.counts_size() - 1);
}

v1::DurationHistogram difference(const v1::DurationHistogram& later, const v1::DurationHistogram& earlier) {
  v1::DurationHistogram result;
  for (int k = 0; k < later.counts_size(); ++k) {
    const uint64_t before = k < earlier.counts_size() ? earlier.counts(k) : 0;
    result.add_counts(later.counts(k) - std::min(before, later.counts(k)));
  }
  result.set_sum_s(std::max(0.0, later.sum_s() - earlier.sum_s()));
  return result;
}

Window window_between(const v1::GetServerStatsResponse& earlier, const v1::GetServerStatsResponse& later) {
  Window window;
  window.seconds = std::max(1e-3, later.uptime_s() - earlier.uptime_s());
  const auto per_s = [&](uint64_t now, uint64_t before) {
    return static_cast<double>(now - std::min(now, before)) / window.seconds;
  };
  window.ticks_per_s = per_s(later.ticks(), earlier.ticks());
  window.steps_per_s = per_s(later.steps(), earlier.steps());
  window.merged_per_s = per_s(later.merged_ticks(), earlier.merged_ticks());
  window.refused_per_s = per_s(later.refused_ticks(), earlier.refused_ticks());
  window.late_share = ratio(per_s(later.late_steps(), earlier.late_steps()), window.steps_per_s);
  window.degraded_share = ratio(per_s(later.degraded_steps(), earlier.degraded_steps()), window.steps_per_s);
  window.received_bytes_per_s = per_s(later.received_bytes(), earlier.received_bytes());
  window.sent_bytes_per_s = per_s(later.sent_bytes(), earlier.sent_bytes());
  window.cpus = std::max(0.0, later.cpu_s() - earlier.cpu_s()) / window.seconds;
  window.cameras = camera_shares(earlier.cameras(), later.cameras());
  window.durations = {row("tick age", later.tick_age(), earlier.tick_age()),
                      row("queue", later.queue(), earlier.queue()), row("step", later.step(), earlier.step())};
  for (const v1::StageHistogram& stage : later.stages())
    window.durations.push_back(row("  " + stage.stage(), stage.durations(), stage_of(earlier, stage.stage())));
  return window;
}

}  // namespace sightline
