// The command `sightline`: flags to options, one file a sub-command.
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <iostream>

#include "client/bench/command.h"
#include "client/bench/echo.h"
#include "client/replay/compare_command.h"
#include "client/recordings/commands.h"
#include "client/drive/drive_command.h"
#include "client/evaluate/evaluate_command.h"
#include "client/replay/replay_command.h"
#include "client/report/report_command.h"
#include "client/command/scene_command.h"
#include "client/cpp/sightline_client.h"
#include "client/command/verb.h"
#include "client/command/wire_presets.h"
#include "server/gl/software_renderer.h"

namespace {

void add_drive(CLI::App& app, sightline::DriveOptions& options) {
  CLI::App* drive = app.add_subcommand(
      "drive",
      "Play a scenario against a server; print how well the camera did, write a trace and a contact sheet");
  drive->add_option("scenario", options.scenario, "A .glb whose node extras hold the roles")
      ->required()
      ->check(CLI::ExistingFile);
  drive->add_option("--server", options.server, "host:port or unix:/path of the daemon")
      ->capture_default_str();
  drive->add_option("--rate", options.rate_hz, "Ticks a second of scenario time, hertz")
      ->check(CLI::Range(0.1, 1000.0))
      ->capture_default_str();
  drive
      ->add_option("--duration", options.duration_s,
                   "Seconds of scenario time to play (default: its animation)")
      ->check(CLI::Range(0.0, 86400.0));
  drive->add_option("--seed", options.seed, "Of all that is random in the session")->capture_default_str();
  drive->add_option("--preset", options.preset, "What the session's settings start from")
      ->check(CLI::IsMember(sightline::preset_names()))
      ->capture_default_str();
  drive->add_option("--out", options.out, "Folder for trace.csv, metrics.json and contact.png")
      ->capture_default_str();
  drive->add_option("--page", options.page,
                    "Also write the session as one HTML page: 3D view, time line, what the camera saw");
  drive->add_flag("--fast", options.lockstep,
                  "As fast as replies come, one tick at a time: the same outcome each time");
  drive->add_flag("!--no-truth", options.truth, "Judge no pictures: no visible shares, no baseline");
  drive->add_option("--truth-every", options.picture_every, "Judge the picture of every n-th frame")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
}

void add_evaluate(CLI::App& app, sightline::EvaluateOptions& options) {
  CLI::App* evaluate = app.add_subcommand("evaluate",
                                          "Play scenes under several camera policies in this process; write "
                                          "tables and plots of how well they did");
  CLI::Option* suite = evaluate
                           ->add_option("--suite", options.suite,
                                        "scenes: all generated ones; paper: the paper's tables 1 to 3")
                           ->check(CLI::IsMember(sightline::suite_names()));
  evaluate
      ->add_option("--scene", options.scenes,
                   "A generated scene by name, or a .glb with roles; may be repeated")
      ->excludes(suite);
  std::vector<std::string> names;
  for (const sightline::PolicyEntry& policy : sightline::policies()) names.emplace_back(policy.name);
  evaluate->add_option("--policy", options.policies, "Which cameras (default: all); may be repeated")
      ->check(CLI::IsMember(names));
  evaluate
      ->add_option("--settings", options.settings,
                   "NAME=JSON: Sightline under these settings (a Settings message of settings.proto, over "
                   "the default preset) as "
                   "a policy of its own; may be repeated")
      ->excludes(suite)
      ->allow_extra_args(false);
  evaluate->add_option("--seeds", options.seeds, "How many variants of each scene: seeds 1 to N")
      ->check(CLI::Range(1, 100))
      ->capture_default_str();
  evaluate->add_option("--rate", options.rate_hz, "Ticks a second of scenario time, hertz")
      ->check(CLI::Range(0.1, 1000.0))
      ->capture_default_str();
  evaluate->add_option("--duration", options.duration_s, "Seconds of each scene at most (default: all of it)")
      ->check(CLI::Range(0.0, 86400.0));
  evaluate->add_option("--truth-every", options.picture_every, "Judge the picture of every n-th frame")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  evaluate
      ->add_option("--frames", options.timed_frames,
                   "Steps to time for each row of the suite paper's table 1")
      ->check(CLI::Range(1, 1000000))
      ->capture_default_str();
  evaluate->add_option("--jobs", options.jobs, "Threads (default: as many as there are cores)")
      ->check(CLI::Range(1, 1024));
  evaluate->add_option("--out", options.out, "Folder for the tables and plots")->capture_default_str();
}

}  // namespace

int main(int argc, char** argv) {
  sightline::prepare_software_rendering();
  CLI::App app("Sightline: a camera that keeps several targets in view");
  app.set_version_flag("--version", "sightline " SIGHTLINE_VERSION);
  app.require_subcommand(1);

  sightline::DriveOptions drive;
  drive.server = sightline::kDefaultAddress;
  drive.progress = isatty(STDERR_FILENO) != 0;
  add_drive(app, drive);

  sightline::EvaluateOptions evaluate;
  evaluate.progress = drive.progress;
  add_evaluate(app, evaluate);

  sightline::BenchOptions bench;
  std::error_code unknown;
  bench.program = std::filesystem::read_symlink("/proc/self/exe", unknown).string();
  bench.progress = drive.progress;
  sightline::add_bench_flags(app, bench);

  std::string echo;
  app.add_subcommand("echo", "A bare gRPC echo, as `bench --echo` starts it: answers until its standard input ends")
      ->add_option("--listen", echo, "host:port or unix:/path")
      ->required();

  std::string scene;
  app.add_subcommand("scene", "Say what a scene file contains")
      ->add_option("file", scene, "A .glb or .gltf")
      ->required()
      ->check(CLI::ExistingFile);

  std::vector<sightline::Verb> verbs = sightline::add_recording_verbs(app);
  verbs.push_back(sightline::add_replay_verb(app));
  verbs.push_back(sightline::add_compare_verb(app));
  verbs.push_back(sightline::add_report_verb(app));

  CLI11_PARSE(app, argc, argv);
  for (const sightline::Verb& verb : verbs)
    if (verb.command->parsed()) return verb.run();
  if (app.got_subcommand("drive")) return sightline::run_drive_command(drive, std::cout, std::cerr);
  if (app.got_subcommand("evaluate")) return sightline::run_evaluate_command(evaluate, std::cout, std::cerr);
  if (app.got_subcommand("bench")) return sightline::run_bench_command(bench, std::cout, std::cerr);
  if (app.got_subcommand("echo")) return sightline::run_echo_command(echo);
  return sightline::run_scene_command(scene, std::cout, std::cerr);
}
