// An evaluation as CSV files and as a table for a person. The same evaluation gives the same bytes; times measured by a
// clock are in write_timing alone. CSV is as in RFC 4180, with a header line; names are quoted.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <ostream>
#include <span>
#include <string>
#include <vector>

#include "client/evaluate/evaluation.h"

namespace sightline {

// One row a run with all its figures. A cell is empty where a run lacks the figure. client/truth/ defines them:
//   metrics.h    run_figures()
//   free_way.h   longest_blind_with_way_s
//   turns.h      turns, mean_turn_answer_s, unanswered_turns
//   reaction.h   sustained_occlusions to unanswered_occlusions; reaction_delays_s lists the single delays, separated by
//   blanks reports.h    reported_pairs to filtered_share_error, and the status: tracking_while_lost,
//   lost_called_tracking,
//                tracking_while_half_hidden
//   motion.h     goal_jumps_per_s
// most_joint and most_worth are the upper estimates of the joint share and of the worth, which only the policies
// "ceiling" and "ceiling-worth" have.
void write_runs(std::ostream& out, std::span<const RunRecord> runs);
// One row a judged picture: its time, the camera's position (world, metres) and the visible share of the target that is
// seen least. The last columns are 0 or 1. `lost`: no pixel of any target is visible. `tracking`: the status is
// TRACKING; empty without a status.
void write_pictures(std::ostream& out, std::span<const RunRecord> runs);
// One row a run and reason: the number of decisions that gave the reason, of those at the judged pictures, and of those
// whose words rays contradict (reasons.h). Two more rows tell of obstructions of the shot. obstruction_expected counts
// the frames that expected one, and those that were wrong. obstruction_not_expected counts those that came, and those
// of them that nothing had announced.
void write_reasons(std::ostream& out, std::span<const RunRecord> runs);
// Seconds a run took and milliseconds a step took.
void write_timing(std::ostream& out, std::span<const RunRecord> runs);

// A table of scene x policy, means over seeds. Where the policies "ceiling" and "ceiling-worth" played too, it shows
// the joint share and the worth as a share of theirs, and the upper estimates of what is possible.
void print_summary(std::ostream& out, std::span<const RunRecord> runs);

// An array with one object for each scene and policy: `scene`, `policy`, `runs`, and the mean over the seeds of every
// figure of write_runs that all of them have, by its name there.
nlohmann::ordered_json summary_json(std::span<const RunRecord> runs);

// The shortest text that reads back as the same double, in any locale.
std::string exact_text(double value);

}  // namespace sightline
