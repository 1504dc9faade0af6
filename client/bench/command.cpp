#include "client/bench/command.h"

#include <CLI/CLI.hpp>
#include <fstream>

#include "client/base/wire_presets.h"

namespace sightline {
namespace {

constexpr const char* kManual = R"(
What happens: the scene is uploaded; every session opens it, with targets that walk through it and boxes that circle near them;
after a warm-up all send at the rate, their phases spread evenly over the tick. Ticks leave when they are due, whether or not
the server keeps up, and every round trip counts from then: a server that stalls shows it. Merged ticks count as well.

What is reported: windows, each judged by itself, until three in a row agree (p50 within 10 %, p99 within 30 %); then the median
of these three, and the least and greatest p50. When none agree in time, all windows are reported as NOT STABLE.
  round_trip   from when a tick was due to the reply that covers it
  transport    round trip - queue - step: gRPC, sockets and scheduling on both sides, the generator's delay (send) included
  queue        in the server, until the step starts; then its stages; step is their sum
CPU and memory are the daemon's as the kernel counts them: of a daemon of its own, or of --daemon-pid.

  sightline bench                                      one session at 60 Hz over a unix socket, daemon started for it
  sightline bench --sessions 100 --json bench.json     a hundred, from a generator on the same machine
  sightline bench --echo                               beside a bare gRPC echo of the same message sizes
  sightline bench --tcp --daemon-flags "--threads 1"   another socket, a daemon with flags of its own
  sightline bench --address unix:/run/sightline.sock   a daemon that runs already)";

void add_load_flags(CLI::App& bench, BenchOptions& options) {
  bench.add_option("--sessions", options.sessions, "Sessions at the same time")
      ->check(CLI::Range(size_t{1}, size_t{10'000}))
      ->capture_default_str();
  bench.add_option("--rate", options.rate_hz, "Ticks a second of each session, hertz")
      ->check(CLI::Range(0.1, 1000.0))
      ->capture_default_str();
  bench.add_option("--targets", options.targets, "Targets of each session")
      ->check(CLI::Range(size_t{1}, size_t{32}))
      ->capture_default_str();
  bench.add_option("--moving", options.moving, "Boxes that circle in each session, moved by every tick")
      ->check(CLI::Range(size_t{0}, size_t{100'000}))
      ->capture_default_str();
  bench
      .add_option("--instances", options.instances,
                  "Boxes in each session, those that stand included (default: --moving)")
      ->check(CLI::Range(size_t{0}, size_t{100'000}));
  bench
      .add_option("--scene", options.scene,
                  "A generated scene by name, or a .glb whose node extras hold the roles")
      ->capture_default_str();
  bench.add_option("--seed", options.seed, "Of the scene, the boxes and the sessions")->capture_default_str();
}

void add_settings_flags(CLI::App& bench, BenchOptions& options) {
  bench.add_option("--preset", options.preset, "What the sessions' settings start from")
      ->check(CLI::IsMember(preset_names()))
      ->capture_default_str();
  bench
      .add_option("--settings", options.settings,
                  "A Settings message of settings.proto as JSON, put over the preset")
      ->type_name("JSON");
  bench.add_option("--resolution", options.resolution, "Texels a side of each depth map")
      ->check(CLI::Range(2, 64));
  bench.add_option("--candidates", options.candidates, "Candidate places, about")
      ->check(CLI::Range(27, 32768));
  bench.add_option("--points", options.points, "Points of each target that a step samples")
      ->check(CLI::Range(0, 16));
}

void add_daemon_flags(CLI::App& bench, BenchOptions& options) {
  CLI::Option* address = bench.add_option(
      "--address", options.address,
      "host:port or unix:/path of a daemon that runs (default: start one, and stop it at the end)");
  bench
      .add_option("--daemon-pid", options.daemon_pid,
                  "Process of the daemon at --address, to watch its CPU and memory")
      ->needs(address);
  bench.add_option("--daemon", options.daemon, "Program to start (default: sightlined beside this one)")
      ->excludes(address)
      ->type_name("PATH");
  bench.add_option("--daemon-flags", options.daemon_flags, "Flags for it, separated by blanks")
      ->excludes(address)
      ->type_name("TEXT");
  bench.add_flag("--tcp", options.tcp, "It listens at a TCP port of the loopback, not at a unix socket")
      ->excludes(address);
}

void add_measuring_flags(CLI::App& bench, BenchOptions& options) {
  bench.add_flag("--echo", options.echo,
                 "In turns with the daemon, load a bare gRPC echo in a process of its own, and compare");
  bench.add_option("--warm-up", options.warm_up_s, "Seconds that are not measured, in whole windows")
      ->check(CLI::Range(0.0, 3600.0))
      ->capture_default_str();
  bench.add_option("--window", options.window_s, "Seconds of a window")
      ->check(CLI::Range(0.1, 3600.0))
      ->capture_default_str();
  bench.add_option("--stable-windows", options.stable.windows, "Windows in a row that must agree")
      ->check(CLI::Range(size_t{1}, size_t{1000}))
      ->capture_default_str();
  bench
      .add_option("--stable-p50", options.stable.p50_share,
                  "How far their p50 may lie apart, as a share of the least")
      ->check(CLI::Range(0.0, 100.0))
      ->capture_default_str();
  bench.add_option("--stable-p99", options.stable.p99_share, "The same of their p99")
      ->check(CLI::Range(0.0, 100.0))
      ->capture_default_str();
  bench
      .add_option("--max-duration", options.max_duration_s,
                  "Seconds after the warm-up until unstable figures are reported")
      ->check(CLI::Range(0.1, 86400.0))
      ->capture_default_str();
  bench.add_option("--threads", options.threads, "Threads that send")
      ->check(CLI::Range(size_t{1}, size_t{64}))
      ->capture_default_str();
  bench
      .add_option("--sessions-per-channel", options.sessions_per_channel,
                  "Sessions that share one connection")
      ->check(CLI::Range(size_t{1}, size_t{1000}))
      ->capture_default_str();
  bench.add_option("--json", options.json, "File for the result; client/README.md has its fields")
      ->type_name("FILE");
}

}  // namespace

void add_bench_flags(CLI::App& app, BenchOptions& options) {
  CLI::App* bench = app.add_subcommand(
      "bench", "Put a load on a daemon; say how long answers take, stage by stage, and what they cost");
  add_load_flags(*bench, options);
  add_settings_flags(*bench, options);
  add_daemon_flags(*bench, options);
  add_measuring_flags(*bench, options);
  bench->footer(kManual);
}

int run_bench_command(const BenchOptions& options, std::ostream& out, std::ostream& err) {
  std::ofstream json;
  if (!options.json.empty()) json.open(options.json);  // found out now rather than after the run
  Result<BenchResult> result = json.fail() ? fail(ErrorCode::kUnavailable, options.json, "cannot be written")
                                           : run_bench(options, err);
  if (result && !options.json.empty() && !(json << bench_json(*result)).flush())
    result = fail(ErrorCode::kUnavailable, options.json, "cannot be written");
  if (!result) {
    err << "sightline bench: " << to_string(result.error()) << '\n';
    return 1;
  }
  print_bench(*result, out);
  return 0;
}

}  // namespace sightline
