// `sightline shots`: the named shots, and one of them as JSON.
#pragma once

#include <cstdint>
#include <ostream>
#include <string>

#include "client/base/verb.h"

namespace sightline {

struct ShotsOptions {
  std::string name;  // empty: list all
  uint64_t subject = 0, other = 0;
  bool json = false;
};

// 0, or 1 with the reason on `err`.
int run_shots_command(const ShotsOptions& options, std::ostream& out, std::ostream& err);

Verb add_shots_verb(CLI::App& app);

}  // namespace sightline
