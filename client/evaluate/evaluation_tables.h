// An evaluation as files: runs.csv, runs.json, summary.md, timing.csv. The same bytes for the same
// evaluation; what was measured by a clock stands in timing.csv alone.
#pragma once

#include <ostream>
#include <span>
#include <string_view>

#include "client/evaluate/evaluation.h"

namespace sightline {

// One figure of a run: a column of runs.csv, a key of runs.json, a bar chart.
struct Figure {
  std::string_view name;     // "d_c_m"
  std::string_view meaning;  // for the title of a chart, with the unit
  double (*of)(const RunRecord& run);
  bool charted = false;
  bool of_words = false;  // only of policies that say what they see: empty or null for the others
};
std::span<const Figure> figures();
// Whether a run has a figure.
bool has(const RunRecord& run, const Figure& figure);

// What a summary row and a bar stand for: the mean over the runs of one scene's seeds under one policy.
struct Group {
  std::string scene, policy;
  std::vector<const RunRecord*> runs;  // at least one
  // Over the runs that have the figure; 0 when none has.
  double mean(const Figure& figure) const;
  double mean(std::string_view figure_name) const;  // must exist
};
// In the order of the runs.
std::vector<Group> group_runs(std::span<const RunRecord> runs);

// A row a run, a head line; comma-separated, names quoted (RFC 4180); numbers with as many digits as they
// need.
void write_csv(std::ostream& out, std::span<const RunRecord> runs);
// An array of runs, the figures and a list of the targets'.
void write_json(std::ostream& out, std::span<const RunRecord> runs);
// A Markdown table, scene x policy.
void write_summary(std::ostream& out, std::span<const RunRecord> runs);
// Seconds a run took and milliseconds a step took: different each time.
void write_timing(std::ostream& out, std::span<const RunRecord> runs);

// ---- cells ----

// Quoted, with quotes doubled: a user's file may have any name.
std::string quoted(const std::string& text);
std::string fixed(double value, int digits);
std::string percent(double share);  // "12.34 %"
// The shortest text that reads back as the same double, whatever the locale.
std::string exact_text(double value);

}  // namespace sightline
