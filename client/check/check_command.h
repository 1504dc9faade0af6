// `sightline check LEVEL`: what a level holds, what is likely to be wrong with it, and a plan of it.
#pragma once

#include <ostream>
#include <string>

#include "client/base/verb.h"

namespace sightline {

struct CheckOptions {
  std::string level;    // path
  std::string plan;     // file for the plan; empty: LEVEL-plan.png in the working folder; "none": no plan
  bool play = false;    // try a camera in it
  bool strict = false;  // warnings are a failure
  bool json = false;
};

// 0; or 1 when the level cannot be read or played or the plan cannot be written, with the reason on `err`, and with
// `strict` also when there are warnings.
int run_check_command(const CheckOptions& options, std::ostream& out, std::ostream& err);

Verb add_check_verb(CLI::App& app);

}  // namespace sightline
