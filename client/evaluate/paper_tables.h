// The paper's tables as files (RFC 4180, a head line), with the paper's printed figures in columns that begin with paper_.
//
// Shares are in [0, 1], in the paper's columns too. What a clock measured stands in columns whose name has "_ms" in it
// (prediction_ms alone is a setting); everything else has the same bytes on every run. A figure that was taken once a seed has
// four columns: <figure>_mean, _median, _least and _most.
#pragma once

#include <ostream>
#include <span>
#include <vector>

#include "client/evaluate/paper_suite.h"

namespace sightline {

// Over seeds. Of an even number of values the median is the middle of the two in the middle.
struct Spread {
  double mean = 0.0, median = 0.0, least = 0.0, most = 0.0;
};
Spread spread_of(std::vector<double> values);  // all 0 without any

// sample, aggregate and move are what the paper calls render, intersect and select.
void write_table1(std::ostream& out, std::span<const TimingRow> rows);

// `runs`: of model_rows() in the hall. step_time_ms is a run's mean time of a step, the scene's own movement included,
// while other runs go on.
void write_table2(std::ostream& out, std::span<const RunRecord> runs);

// `runs`: of stability_rows() in "fence" and in "fence-board". d_c_ratio and d_s_ratio say by how much a row travels less than
// the row without a filter of the same seed. The occlusions and what follows of reactions are of "fence-board", all seeds
// together, empty when no lasting occlusion occurred; the rest is of "fence".
void write_table3(std::ostream& out, std::span<const RunRecord> runs);

// The three in short, for a person at a terminal: Markdown.
void write_paper_summary(std::ostream& out, const PaperResults& results);

}  // namespace sightline
