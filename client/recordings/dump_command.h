// `sightline dump FILE`: the messages of a recording, or of any MCAP file, as lines of JSON.
#pragma once

#include <limits>
#include <ostream>
#include <string>
#include <vector>

#include "client/base/verb.h"

namespace sightline {

struct DumpOptions {
  std::string file = {};
  std::vector<std::string> topics = {};  // empty: all
  // Seconds of log time since the first message of the file: start <= t < end.
  double start_s = 0.0;
  double end_s = std::numeric_limits<double>::infinity();
  uint64_t limit = std::numeric_limits<uint64_t>::max();  // lines
  std::string out = {};                                   // a new file; empty: the standard output
  bool progress = false;
};

// A line: {"topic", "sequence", "log_time_ns", "publish_time_ns", "message"}. A message that cannot be decoded has "error"
// instead of "message". Ends quietly when nobody reads on. 0; 1: the file cannot be read, has none of the topics, or
// something of it was lost or could not be decoded, with the reason on `err`.
int run_dump_command(const DumpOptions& options, std::ostream& out, std::ostream& err);

Verb add_dump_verb(CLI::App& app);

}  // namespace sightline
