#include "client/bench/statistics.h"

#include <algorithm>
#include <limits>

#include "client/truth/metrics.h"

namespace sightline {
namespace {

std::vector<double> each(std::span<const Quantiles> windows, double Quantiles::*figure) {
  std::vector<double> values;
  for (const Quantiles& window : windows) values.push_back(window.*figure);
  return values;
}

}  // namespace

Quantiles quantiles_of(const std::vector<double>& values) {
  return {values.size(),
          percentile(values, 0.5),
          percentile(values, 0.9),
          percentile(values, 0.99),
          percentile(values, 0.999),
          percentile(values, 1.0)};
}

Spread spread_of(const std::vector<double>& values) {
  return {percentile(values, 0.5), percentile(values, 0.0), percentile(values, 1.0)};
}

double relative_range(const std::vector<double>& values) {
  const Spread spread = spread_of(values);
  if (spread.least == spread.most) return 0.0;
  return spread.least > 0.0 ? (spread.most - spread.least) / spread.least
                            : std::numeric_limits<double>::infinity();
}

bool agree(std::span<const Quantiles> windows, const StableRule& rule) {
  if (windows.size() < rule.windows) return false;
  const auto last = windows.last(rule.windows);
  if (std::any_of(last.begin(), last.end(), [](const Quantiles& window) { return window.count == 0; }))
    return false;
  return relative_range(each(last, &Quantiles::p50)) <= rule.p50_share &&
         relative_range(each(last, &Quantiles::p99)) <= rule.p99_share;
}

}  // namespace sightline
