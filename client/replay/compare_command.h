// `sightline compare A B`: two recordings of one session's ticks, reply by reply.
#pragma once

#include <ostream>
#include <string>

#include "client/base/verb.h"

namespace sightline {

struct CompareOptions {
  std::string a, b;   // files
  bool json = false;  // one object instead of a table
  bool progress = false;
};

// 0: every reply of each is in the other and equal; 1: not so, or it failed with the reason on `err`. Differing inputs
// are reported, but do not change the exit status.
int run_compare_command(const CompareOptions& options, std::ostream& out, std::ostream& err);

Verb add_compare_verb(CLI::App& app);

}  // namespace sightline
