// What many latencies come to: exact percentiles of a window, and when windows agree well enough to be reported.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace sightline {

// By nearest rank, of every value that was seen: nothing is binned and nothing sampled. All 0 without values.
struct Quantiles {
  size_t count = 0;
  double p50 = 0.0, p90 = 0.0, p99 = 0.0, p999 = 0.0, max = 0.0;
};
Quantiles quantiles_of(const std::vector<double>& values);

// One figure over several windows. All 0 without values.
struct Spread {
  double median = 0.0, least = 0.0, most = 0.0;
};
Spread spread_of(const std::vector<double>& values);

// How far windows may lie apart: (greatest - least) / least of each figure.
struct StableRule {
  size_t windows = 3;      // this many consecutive ones must agree, >= 1
  double p50_share = 0.1;  // [0, ...)
  double p99_share = 0.3;
};

// (greatest - least) / least; infinite when the least is 0 and the greatest is not, 0 for no values.
double relative_range(const std::vector<double>& values);

// Do the last `rule.windows` of `windows` agree? No when there are fewer, or when one of them saw nothing.
bool agree(std::span<const Quantiles> windows, const StableRule& rule);

}  // namespace sightline
