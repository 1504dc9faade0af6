#include "client/bench/command.h"

#include <CLI/CLI.hpp>
#include <fstream>

#include "client/base/wire_presets.h"

namespace sightline {
namespace {

constexpr const char* kManual = R"(
The scene is uploaded and every session opens it, with targets that walk through it and boxes that circle near them. After a
warm-up all sessions send at the rate, with their phases spread evenly over the tick. Ticks leave when they are due, whether or
not the server keeps up, and every round trip counts from that time, so a stalled server shows. Merged ticks count as well.

Figures are taken by window. When three windows in a row agree (p50 within 10 %, p99 within 30 %), their median is reported with
the least and greatest p50. When none agree in time, all windows are reported as NOT STABLE.
  round_trip   from when a tick was due to the reply that covers it
  transport    round trip - queue - step: gRPC, sockets and scheduling on both sides, and the generator's delay (send)
  queue        in the server, until the step starts; then follow the stages of the step and their sum
CPU time and memory are the daemon's, as the kernel counts them; for a daemon at --address, give --daemon-pid.

  sightline bench                                      one session at 60 Hz over a unix socket to a daemon of its own
  sightline bench --sessions 100 --json bench.json     a hundred sessions
  sightline bench --tcp --daemon-flags "--threads 1"   another socket, a daemon with flags of its own
  sightline bench --address unix:/run/sightline.sock   a daemon that is already running)";

void add_load_flags(CLI::App& bench, BenchOptions& options) {
  bench.add_option("--sessions", options.world.sessions, "Sessions at the same time")
      ->check(CLI::Range(size_t{1}, size_t{10'000}))
      ->capture_default_str();
  bench.add_option("--rate", options.world.rate_hz, "Ticks a second of each session, hertz")
      ->check(CLI::Range(0.1, 1000.0))
      ->capture_default_str();
  bench.add_option("--targets", options.world.targets, "Targets of each session")
      ->check(CLI::Range(size_t{1}, size_t{32}))
      ->capture_default_str();
  bench.add_option("--moving", options.world.moving, "Boxes that circle in each session, moved by every tick")
      ->check(CLI::Range(size_t{0}, size_t{100'000}))
      ->capture_default_str();
  bench
      .add_option("--instances", options.world.instances,
                  "All boxes in each session, moving or not (default: --moving)")
      ->check(CLI::Range(size_t{0}, size_t{100'000}));
  bench.add_option("--scene", options.scene, "A generated scene by name, or a .glb whose node extras hold the roles")
      ->capture_default_str();
  bench.add_option("--seed", options.world.seed, "Seed of the scene, the boxes and the sessions")
      ->capture_default_str();
}

void add_settings_flags(CLI::App& bench, BenchOptions& options) {
  bench.add_option("--preset", options.preset, "Preset that the sessions' settings start from")
      ->check(CLI::IsMember(preset_names()))
      ->capture_default_str();
  bench
      .add_option("--settings", options.settings,
                  "JSON over the preset: {\"settings\":{...},\"tuning\":{...}}, see proto/SETTINGS.md")
      ->type_name("JSON");
  bench.add_option("--resolution", options.resolution, "Side of each depth map, texels")->check(CLI::Range(2, 64));
  bench.add_option("--candidates", options.candidates, "Approximate number of candidates")
      ->check(CLI::Range(27, 32768));
  bench.add_option("--points", options.points, "Points sampled on each target in a step")->check(CLI::Range(0, 16));
}

void add_daemon_flags(CLI::App& bench, BenchOptions& options) {
  CLI::Option* address = bench.add_option(
      "--server,--address", options.address,
      "host:port or unix:/path of a running daemon (default: start one and stop it at the end)");
  add_connection_flags(bench, options.connection);
  bench
      .add_option("--daemon-pid", options.daemon_pid,
                  "Process of the daemon at --address, to watch its CPU time and memory")
      ->needs(address);
  bench.add_option("--daemon", options.daemon, "Program to start (default: sightlined beside this one)")
      ->excludes(address)
      ->type_name("PATH");
  bench.add_option("--daemon-flags", options.daemon_flags, "Flags for the started daemon, separated by blanks")
      ->excludes(address)
      ->type_name("TEXT");
  bench
      .add_flag("--tcp", options.tcp, "The started daemon listens at a TCP port of the loopback, not at a unix socket")
      ->excludes(address);
}

void add_measuring_flags(CLI::App& bench, BenchOptions& options) {
  bench
      .add_option("--echo", options.echo,
                  "host:port or unix:/path of a bare gRPC echo (tests/bench/echo_server) to load in turns with the "
                  "daemon, and to compare with")
      ->type_name("ADDRESS");
  bench.add_option("--warm-up", options.warm_up_s, "Seconds before the first window, rounded up to whole windows")
      ->check(CLI::Range(0.0, 3600.0))
      ->capture_default_str();
  bench.add_option("--window", options.window_s, "Length of a window, seconds")
      ->check(CLI::Range(0.1, 3600.0))
      ->capture_default_str();
  bench.add_flag("--all-windows", options.all_windows,
                 "Measure for all of --max-duration and report every window, whether or not they agree");
  bench.add_option("--max-duration", options.max_duration_s, "Seconds to measure after the warm-up at most")
      ->check(CLI::Range(0.1, 86400.0))
      ->capture_default_str();
  bench.add_option("--sessions-per-channel", options.sessions_per_channel, "Sessions that share one connection")
      ->check(CLI::Range(size_t{1}, size_t{1000}))
      ->capture_default_str();
  bench
      .add_option("--json", options.json,
                  "File for the result; client/README.md has its fields. - writes it to the standard output instead of "
                  "the table")
      ->type_name("FILE");
}

}  // namespace

void add_bench_flags(CLI::App& app, BenchOptions& options) {
  CLI::App* bench = app.add_subcommand(
      "bench", "Put a load on a daemon; report how long answers take, stage by stage, and what they cost");
  add_load_flags(*bench, options);
  add_settings_flags(*bench, options);
  add_daemon_flags(*bench, options);
  add_measuring_flags(*bench, options);
  bench->footer(kManual);
}

int run_bench_command(const BenchOptions& options, std::ostream& out, std::ostream& err) {
  const bool only_json = options.json == "-";
  std::ofstream file;
  if (!options.json.empty() && !only_json) file.open(options.json);  // first, so that a bad path is reported at once
  std::ostream& json = only_json ? out : file;
  Result<BenchJson> result = json.fail() ? fail(ErrorCode::kUnavailable, options.json, "cannot be written")
                                         : run_bench(options, err);
  if (result && !options.json.empty() && !(json << result->dump(2) << '\n').flush())
    result = fail(ErrorCode::kUnavailable, options.json, "cannot be written");
  if (!result) {
    err << "sightline bench: " << to_string(result.error()) << '\n';
    return 1;
  }
  if (!only_json) print_bench(*result, out);
  return 0;
}

}  // namespace sightline
