// `sightline evaluate`: scenes x policies x settings, played and judged in this process, as tables and plots.
//
// The suite "paper" instead plays the paper's tables (see paper_suite.h and paper_tables.h) and writes
//   table1.csv, table2.csv, table3.csv
//   plots/table2-r_n.svg, table2-r_p.svg, table3-offset.svg
// Everything else writes into the folder `out`:
//   runs.csv, runs.json       a row a run, every figure
//   summary.md                scene x policy
//   timing.csv                what a clock measured; every other file has the same bytes on every run
//   plots/<scene>-s<seed>-share.svg, -path.svg; plots/bars-<figure>.svg
#pragma once

#include <ostream>
#include <string>
#include <vector>

#include "client/evaluate/evaluation.h"

namespace sightline {

struct EvaluateOptions {
  std::string suite;                  // "scenes": every generated scene; "paper"; empty: `scenes` says which
  std::vector<std::string> scenes;    // names of generated scenes, and paths of .glb or .gltf files
  std::vector<std::string> policies;  // empty: all; must be empty with suite "paper"
  std::vector<std::string> settings;  // NAME=JSON, each a policy of its own after the others, see named_settings.h
  int seeds = 5;                      // [1, 100]: seeds 1 .. n
  double rate_hz = 60.0;
  double duration_s = 0.0;  // at most this much of each scene; 0: all
  int picture_every = 6;
  int timed_frames = 5000;  // >= 1; steps of each row of Table 1; suite "paper" only
  int jobs = 0;             // 0: as many as there are cores
  std::string out = "evaluation";
  bool progress = false;  // a bar on `err`
};

// The names that --suite takes.
std::vector<std::string> suite_names();

// The scene cases that the options ask for; not of suite "paper". Of a generated scene one a seed, of the arena with 2 .. 8 targets
// each; of a file one a seed too, which then is the session's alone. kNotFound: neither a scene nor a file;
// kInvalidArgument: nothing is asked for, or both a suite and scenes.
Result<std::vector<SceneCase>> cases_of(const EvaluateOptions& options);

// 0 when all was played and written, else 1 with the reason on `err`.
int run_evaluate_command(const EvaluateOptions& options, std::ostream& out, std::ostream& err);

}  // namespace sightline
