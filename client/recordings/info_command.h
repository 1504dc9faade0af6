// `sightline info FILE...`: what recordings contain.
#pragma once

#include <ostream>
#include <string>
#include <vector>

#include "client/base/verb.h"

namespace sightline {

struct InfoOptions {
  std::vector<std::string> files = {};
  bool json = false;  // one object a line for each file
  bool progress = false;
};

// 0; 1 when a file cannot be read, with the reason on `err`: the others are told all the same.
int run_info_command(const InfoOptions& options, std::ostream& out, std::ostream& err);

Verb add_info_verb(CLI::App& app);

}  // namespace sightline
