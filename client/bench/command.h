// `sightline bench`: puts a load on a daemon and says what it costs and how long it takes.
#pragma once

#include <sys/types.h>

#include <optional>
#include <ostream>
#include <string>

#include "client/bench/result.h"
#include "server/base/error.h"

namespace CLI {
class App;
}

namespace sightline {

struct BenchOptions {
  // The load.
  size_t sessions = 1;         // [1, 10000]
  double rate_hz = 60.0;       // of each session, (0, 1000]
  size_t targets = 2;          // [1, 32]
  size_t moving = 0;           // boxes that circle, a session
  size_t instances = 0;        // boxes in all, a session; fewer than `moving`: as many as that
  std::string scene = "city";  // a generated scene by name, or a .glb with roles
  uint64_t seed = 1;
  std::string preset = "sightline";
  std::string settings;                                    // see settings_from_json; put over the preset
  std::optional<uint32_t> resolution, candidates, points;  // put over both

  // Whom it meets.
  std::string address;       // host:port or unix:/path; empty: a daemon of its own
  pid_t daemon_pid = 0;      // of the daemon at `address`, to watch its CPU time and memory; 0: not watched
  std::string daemon;        // the program; empty: sightlined beside `program`
  std::string daemon_flags;  // separated by blanks
  bool tcp = false;          // the daemon of its own listens at TCP, not at a unix socket
  std::string program;       // this program, for the echo

  // How it is sent and measured.
  size_t threads = 1;                // that send, >= 1
  size_t sessions_per_channel = 16;  // >= 1
  double warm_up_s = 2.0;
  double window_s = 2.0;
  double max_duration_s = 60.0;  // after the warm-up; at least one window is measured
  StableRule stable;
  bool echo = false;

  std::string json;       // file to write; empty: none
  bool progress = false;  // a bar on `err`
};

// The sub-command with its flags and its manual; they write to `options`.
void add_bench_flags(CLI::App& app, BenchOptions& options);

// Errors: kNotFound a scene or a daemon program that is not there, kUnavailable a daemon that does not come up, answer or live on,
// kResourceExhausted a session that was refused for want of room, kInvalidArgument settings or a scene that cannot be taken.
Result<BenchResult> run_bench(const BenchOptions& options, std::ostream& err);

// 0 when a result was reported, stable or not; else 1 with the reason on `err`.
int run_bench_command(const BenchOptions& options, std::ostream& out, std::ostream& err);

}  // namespace sightline
