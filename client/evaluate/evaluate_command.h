// `sightline evaluate`: plays scenes under camera policies in this process and judges every run. It writes into the
// folder `out`:
//
//   runs.csv       one row a run, every figure
//   pictures.csv   one row a judged picture: where the camera was and what it saw
//   reasons.csv    one row a run and reason: how often it was given, and how often it was false
//   sheets/        if they are asked for: eight pictures of each run, <scene>-<seed>-<policy>.jpg
//   timing.csv     times measured by a clock; the other files have the same bytes on every run
#pragma once

#include <cstdint>
#include <ostream>
#include <string>
#include <vector>

#include "client/evaluate/evaluation.h"

namespace sightline {

struct EvaluateOptions {
  std::vector<std::string> scenes;  // names of generated scenes, and paths of .glb or .gltf files
  std::vector<std::string> groups;  // of generated scenes, by name; without scenes and groups: "study"
  // folder of the tile set; empty: the environment variable SIGHTLINE_TILES names it
  std::string tiles;
  // the same of recorded motion: SIGHTLINE_MOTION
  std::string motion;
  std::vector<std::string> policies;  // names; empty: all built-in policies but the ceilings
  std::vector<std::string> settings;  // NAME=JSON, each a further policy (read_named_settings in policy.h)
  int seeds = 5;                      // [1, 100]: how many, one after the other
  uint64_t first_seed = 1;
  double rate_hz = 60.0;
  double duration_s = 0.0;  // longest part of each scene to play; 0: all of it
  int picture_every = 6;
  int jobs = 0;                    // number of threads; 0: one per core
  std::string sampler = "embree";  // of Sightline's own policies: "embree" or "egl"
  std::string out = "evaluation";
  bool sheets = false;    // draw contact sheets
  bool json = false;      // print one JSON object instead of a table
  bool progress = false;  // draw a bar on `err`
};

// The scene cases that the options ask for, one a seed. A generated scene that comes in several sizes gives a case for
// each size: the arena with 2 to 8 targets, the crowd with 0 to 35 others. A file is the same at every seed; only the
// session's seed changes. kNotFound: a name is neither a generated scene nor a file, a group does not exist, or the
// folder of the tiles or of the recorded motion is missing. kInvalidArgument: a recording is broken.
Result<std::vector<SceneCase>> cases_of(const EvaluateOptions& options);

// 0 when everything was played and written, else 1 with the reason on `err`.
int run_evaluate_command(const EvaluateOptions& options, std::ostream& out, std::ostream& err);

}  // namespace sightline
