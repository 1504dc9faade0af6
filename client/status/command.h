// `sightline status`, `sightline sessions` and `sightline top`: how a running daemon and its cameras are.
#pragma once

#include <cstdint>
#include <ostream>
#include <string>

#include "client/base/connection_flags.h"
#include "client/base/verb.h"

namespace sightline {

struct StatusOptions {
  std::string address;
  ConnectionFlags connection = {};
  bool json = false;
};
// Prints the state of the daemon, and what it did since its start. Returns 0; 1 when it is not ready, or cannot be
// asked, with the reason on `err`.
int run_status_command(const StatusOptions& options, std::ostream& out, std::ostream& err);

// Prints the open sessions and what their cameras show. Returns 0; 1 when the daemon cannot be asked, with the reason
// on `err`.
int run_sessions_command(const StatusOptions& options, std::ostream& out, std::ostream& err);

struct TopOptions {
  std::string address;
  ConnectionFlags connection = {};
  double interval_s = 2.0;
  uint64_t count = 0;     // of windows to show; 0: until a signal ends the process
  bool terminal = false;  // each window replaces the one before
  bool json = false;      // one JSON object a line for each window
};
// Prints the state, and what the daemon did within each interval. Returns 0 after `count` windows; 1 when the daemon
// cannot be asked, with the reason on `err`.
int run_top_command(const TopOptions& options, std::ostream& out, std::ostream& err);

Verb add_status_verb(CLI::App& app);
Verb add_sessions_verb(CLI::App& app);
Verb add_top_verb(CLI::App& app);

}  // namespace sightline
