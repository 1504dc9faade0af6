// `sightline recover FILE --out FILE`: a sound copy of a recording that is damaged or was not finished.
#pragma once

#include <ostream>
#include <string>

#include "client/base/verb.h"

namespace sightline {

struct RecoverOptions {
  std::string file = {};
  std::string out = {};  // a new file
  bool progress = false;
};

// Copies whatever stands in whole chunks and records, and says what was lost. A copy that lacks something says so in its
// metadata `sightline.recovered`. 0: the copy is sound; 1: there is none, with the reason on `err`.
int run_recover_command(const RecoverOptions& options, std::ostream& out, std::ostream& err);

Verb add_recover_verb(CLI::App& app);

}  // namespace sightline
