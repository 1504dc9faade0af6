// `sightline cut FILE --out FILE`: a part of a recording as a recording that stands alone.
#pragma once

#include <limits>
#include <ostream>
#include <string>

#include "client/base/verb.h"

namespace sightline {

struct CutOptions {
  std::string file = {};
  std::string out = {};  // a new file
  // Seconds of log time since the first message of the file, as client/recordings/cut.h takes them.
  double start_s = 0.0;
  double end_s = std::numeric_limits<double>::infinity();
  bool progress = false;
};

// 0; 1: there is no cut, or it lacks what was damaged in the recording, with the reason on `err`; 2: an empty range.
int run_cut_command(const CutOptions& options, std::ostream& out, std::ostream& err);

Verb add_cut_verb(CLI::App& app);

}  // namespace sightline
