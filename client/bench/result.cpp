#include "client/bench/result.h"

#include <algorithm>
#include <numeric>

namespace sightline {
namespace {

using Windows = std::vector<MeasuredWindow>;

// `value` of each window.
template <typename Value>
std::vector<double> each(const Windows& windows, Value value) {
  std::vector<double> values;
  for (const MeasuredWindow& window : windows) values.push_back(static_cast<double>(value(window)));
  return values;
}

template <typename Value>
uint64_t sum(const Windows& windows, Value value) {
  return std::accumulate(windows.begin(), windows.end(), uint64_t{0},
                         [&](uint64_t total, const MeasuredWindow& window) { return total + value(window); });
}

double per(double value, double count) {
  return count > 0.0 ? value / count : 0.0;
}

// `values` gives the latencies of one window.
template <typename Values>
MetricFigures figures_of(const Windows& windows, Values values) {
  std::vector<double> p50, p90, p99, p999, max;
  MetricFigures figures;
  for (const MeasuredWindow& window : windows) {
    const Quantiles q = quantiles_of(values(window));
    figures.count += q.count;
    p50.push_back(q.p50);
    p90.push_back(q.p90);
    p99.push_back(q.p99);
    p999.push_back(q.p999);
    max.push_back(q.max);
  }
  figures.p50 = spread_of(p50);
  figures.p90 = spread_of(p90);
  figures.p99 = spread_of(p99);
  figures.p999 = spread_of(p999);
  figures.max = spread_of(max);
  return figures;
}

double p50_of(const std::vector<double>& values) {
  return quantiles_of(values).p50;
}

EchoComparison compare(const Windows& windows) {
  EchoComparison echo;
  echo.round_trip =
      figures_of(windows, [](const MeasuredWindow& w) { return w.echo->of(BenchMetric::kRoundTrip); });
  echo.send = figures_of(windows, [](const MeasuredWindow& w) { return w.echo->of(BenchMetric::kSend); });
  const auto floor = [](const MeasuredWindow& w) {
    return p50_of(w.echo->of(BenchMetric::kRoundTrip)) + p50_of(w.daemon.of(BenchMetric::kStep));
  };
  echo.floor_us = spread_of(each(windows, floor));
  echo.share = spread_of(each(windows, [&](const MeasuredWindow& w) {
    return per(p50_of(w.daemon.of(BenchMetric::kRoundTrip)), floor(w));
  }));
  echo.server_cpu_us = spread_of(each(windows, [](const MeasuredWindow& w) { return w.echo_cpu_us; }));
  echo.generator_cpu_us =
      spread_of(each(windows, [](const MeasuredWindow& w) { return w.echo_generator_cpu_us; }));
  return echo;
}

WindowFigures figures_of(const MeasuredWindow& window) {
  const Quantiles round_trip = quantiles_of(window.daemon.of(BenchMetric::kRoundTrip));
  return {.round_trip_p50_us = round_trip.p50,
          .round_trip_p99_us = round_trip.p99,
          .step_p50_us = p50_of(window.daemon.of(BenchMetric::kStep)),
          .late_share = per(static_cast<double>(window.daemon.late), static_cast<double>(window.daemon.ticks())),
          .degraded_share =
              per(static_cast<double>(window.daemon.degraded), static_cast<double>(window.daemon.replies)),
          .daemon_cpu_us = window.daemon_cpu_us};
}

void sum_up_service(const Windows& windows, BenchResult& result) {
  const double seconds = result.window_s * static_cast<double>(windows.size());
  std::vector<double> replies(result.sessions, 0.0);
  for (const MeasuredWindow& window : windows)
    for (size_t i = 0; i < replies.size(); ++i)
      replies[i] += static_cast<double>(window.replies_by_session[i]);
  const Spread served = spread_of(replies);
  result.least_served_hz = per(served.least, seconds);
  result.most_served_hz = per(served.most, seconds);
  result.achieved_hz =
      per(static_cast<double>(result.replies), seconds * static_cast<double>(result.sessions));
}

void sum_up_processor(const Windows& windows, BenchResult& result) {
  result.generator_cpu_us =
      spread_of(each(windows, [](const MeasuredWindow& w) { return w.generator_cpu_us; }));
  if (std::all_of(windows.begin(), windows.end(), [](const auto& w) { return w.daemon_cpu_us.has_value(); }))
    result.daemon_cpu_us = spread_of(each(windows, [](const MeasuredWindow& w) { return *w.daemon_cpu_us; }));
}

}  // namespace

std::optional<double> BenchMemory::per_session() const {
  if (session_count < 2) return std::nullopt;
  return (static_cast<double>(sessions) - static_cast<double>(scene)) /
         static_cast<double>(session_count - 1);
}

void summarize(const Windows& windows, BenchResult& result) {
  result.windows = windows.size();
  result.course.clear();
  for (const MeasuredWindow& window : windows) result.course.push_back(figures_of(window));
  for (size_t metric = 0; metric < kBenchMetrics; ++metric)
    result.metrics[metric] =
        figures_of(windows, [&](const MeasuredWindow& w) { return w.daemon.us[metric]; });
  const auto figure = [&](double Quantiles::*part) {
    return relative_range(each(windows, [&](const MeasuredWindow& w) {
      return quantiles_of(w.daemon.of(BenchMetric::kRoundTrip)).*part;
    }));
  };
  result.p50_range = figure(&Quantiles::p50);
  result.p99_range = figure(&Quantiles::p99);
  result.ticks = sum(windows, [](const MeasuredWindow& w) { return w.daemon.ticks(); });
  result.replies = sum(windows, [](const MeasuredWindow& w) { return w.daemon.replies; });
  result.late = sum(windows, [](const MeasuredWindow& w) { return w.daemon.late; });
  result.degraded = sum(windows, [](const MeasuredWindow& w) { return w.daemon.degraded; });
  const uint64_t tick_bytes = sum(windows, [](const MeasuredWindow& w) { return w.daemon.tick_bytes; });
  const uint64_t reply_bytes = sum(windows, [](const MeasuredWindow& w) { return w.daemon.reply_bytes; });
  const uint64_t sent =
      sum(windows, [](const MeasuredWindow& w) { return w.daemon.of(BenchMetric::kSend).size(); });
  result.tick_bytes = per(static_cast<double>(tick_bytes), static_cast<double>(sent));
  result.reply_bytes = per(static_cast<double>(reply_bytes), static_cast<double>(result.replies));
  sum_up_service(windows, result);
  sum_up_processor(windows, result);
  if (std::all_of(windows.begin(), windows.end(), [](const auto& w) { return w.echo.has_value(); }))
    result.echo = compare(windows);
}

}  // namespace sightline
