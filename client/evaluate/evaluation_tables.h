// An evaluation as CSV files and as a table for a person. The same evaluation gives the same bytes; times measured by a clock
// are in write_timing alone. CSV is as in RFC 4180, with a header line; names are quoted.
#pragma once

#include <ostream>
#include <span>
#include <string>
#include <vector>

#include "client/evaluate/evaluation.h"

namespace sightline {

// One row a run with all its figures: run_figures() (client/truth/metrics.h), reactions (client/truth/reaction.h), the errors of
// what the policy reports (client/truth/reports.h) and the jumps of its goal (client/truth/motion.h). reaction_delays_s lists
// the single delays, separated by blanks. A cell is empty where a run lacks the figure.
void write_runs(std::ostream& out, std::span<const RunRecord> runs);
// One row a judged picture: when, where the camera was (world, metres), the visible share of the target that is seen least.
void write_pictures(std::ostream& out, std::span<const RunRecord> runs);
// Seconds a run took and milliseconds a step took.
void write_timing(std::ostream& out, std::span<const RunRecord> runs);

// A table of scene x policy, means over seeds.
void print_summary(std::ostream& out, std::span<const RunRecord> runs);

// The shortest text that reads back as the same double, in any locale.
std::string exact_text(double value);

}  // namespace sightline
