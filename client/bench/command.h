// `sightline bench`: puts a load on a daemon; reports how long answers take and what they cost.
#pragma once

#include <sys/types.h>

#include <optional>
#include <ostream>
#include <string>

#include "client/base/connection_flags.h"
#include "client/bench/result.h"
#include "client/bench/world.h"
#include "server/base/error.h"

namespace CLI {
class App;
}

namespace sightline {

struct BenchOptions {
  // The load.
  BenchWorldOptions world;     // `instances` is raised to `moving`
  std::string scene = "city";  // a generated scene by name, or a .glb with roles
  std::string preset = "sightline";
  std::string settings;                                    // see settings_from_json; over the preset
  std::optional<uint32_t> resolution, candidates, points;  // over both

  // The daemon.
  std::string address;              // host:port or unix:/path of a running daemon; empty: one is started
  ConnectionFlags connection = {};  // to the daemon at `address`
  pid_t daemon_pid = 0;             // the process at `address`, to watch its CPU time and memory; 0: not watched
  std::string daemon;               // program to start; empty: sightlined beside `program`
  std::string daemon_flags;  // for it, separated by blanks; it has room for all sessions unless they say otherwise
  bool tcp = false;          // it listens at TCP, not at a unix socket
  std::string program;       // the path of this program

  // How the load is sent and measured.
  size_t sessions_per_channel = 16;  // >= 1
  double warm_up_s = 2.0;
  double window_s = 2.0;
  double max_duration_s = 60.0;  // after the warm-up; at least one window is measured
  bool all_windows = false;      // measure for max_duration_s and report every window, not the first stable ones
  std::string echo;              // host:port or unix:/path of a bare echo to load in turns with the daemon; empty: none

  std::string json;       // file to write; empty: none
  bool progress = false;  // a bar on `err`
};

// Adds the sub-command with its flags and manual. The flags write to `options`.
void add_bench_flags(CLI::App& app, BenchOptions& options);

// The result as client/README.md describes it. kNotFound: a scene or a daemon program is missing. kUnavailable: the
// daemon does not start, answer or stay alive. kResourceExhausted: the daemon had no room for a session.
// kInvalidArgument: settings or scene are not valid.
Result<BenchJson> run_bench(const BenchOptions& options, std::ostream& err);

// 0 when a result was reported, stable or not; else 1 with the reason on `err`.
int run_bench_command(const BenchOptions& options, std::ostream& out, std::ostream& err);

}  // namespace sightline
