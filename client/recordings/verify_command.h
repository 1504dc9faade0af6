// `sightline verify FILE...`: whether recordings are whole and tell a session that can have been.
#pragma once

#include <ostream>
#include <string>
#include <vector>

#include "client/base/verb.h"

namespace sightline {

struct VerifyOptions {
  std::vector<std::string> files = {};
  bool json = false;
  bool progress = false;
};

// 0: all of them are sound; 1: one is not, or cannot be read. What a Gap tells of is no fault of the file, and what a
// recovered file lost before it was recovered is told, but no fault of the copy.
int run_verify_command(const VerifyOptions& options, std::ostream& out, std::ostream& err);

Verb add_verify_verb(CLI::App& app);

}  // namespace sightline
