// The command `sightline`: reads the flags and runs the sub-command that was asked for.
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <iostream>

#include "client/base/verb.h"
#include "client/base/wire_presets.h"
#include "client/bench/command.h"
#include "client/check/check_command.h"
#include "client/command/scene_command.h"
#include "client/cpp/sightline_client.h"
#include "client/demo/demo_command.h"
#include "client/drive/drive_command.h"
#include "client/evaluate/evaluate_command.h"
#include "client/recordings/commands.h"
#include "client/replay/compare_command.h"
#include "client/replay/replay_command.h"
#include "client/report/report_command.h"
#include "client/shots/shots_command.h"
#include "client/status/command.h"
#include "server/command_table.h"
#include "server/gl/software_renderer.h"

namespace {

void add_drive(CLI::App& app, sightline::DriveOptions& options) {
  CLI::App* drive = app.add_subcommand(
      "drive", "Play a scenario against a server; print how well the camera did, write a trace and a contact sheet");
  drive->add_option("scenario", options.scenario, "A .glb whose node extras hold the roles")
      ->required()
      ->check(CLI::ExistingFile);
  drive->add_option("--server,--address", options.server, "host:port or unix:/path of the daemon")
      ->capture_default_str();
  sightline::add_connection_flags(*drive, options.connection);
  drive->add_option("--rate", options.rate_hz, "Ticks a second of scenario time, hertz")
      ->check(CLI::Range(0.1, 1000.0))
      ->capture_default_str();
  drive->add_option("--duration", options.duration_s, "Seconds of scenario time to play (default: its animation)")
      ->check(CLI::Range(0.0, 86400.0));
  drive->add_option("--seed", options.seed, "Seed of the session's random numbers")->capture_default_str();
  drive->add_option("--preset", options.preset, "Preset that the session's settings start from")
      ->check(CLI::IsMember(sightline::preset_names()))
      ->capture_default_str();
  drive->add_option("--shot", options.shot,
                    "A named shot (`sightline shots` lists them), or the part of a Tick that asks for one as JSON. The "
                    "subject is the first target, the other the second");
  drive->add_option("--out", options.out, "Folder for trace.csv, metrics.json, contact.png and comparison.png")
      ->capture_default_str();
  drive->add_option("--page", options.page,
                    "Also write the session as one HTML page: 3D view, time line, what the camera saw");
  drive->add_flag(
      "--fast", options.lockstep,
      "Wait for each reply before the next tick, instead of playing in real time: the same outcome each time");
  drive->add_flag("!--no-truth", options.truth, "Do not re-render what the camera saw: no visible shares, no baseline");
  drive->add_option("--truth-every", options.picture_every, "Re-render and judge every n-th frame")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  drive->add_flag(
      "--json", options.json,
      "One JSON object at the end instead of text: the figures of metrics.json, latencies, files, warnings");
}

void add_evaluate(CLI::App& app, sightline::EvaluateOptions& options) {
  CLI::App* evaluate = app.add_subcommand(
      "evaluate", "Play scenes under several camera policies in this process; write tables of how well they did");
  evaluate->add_option("--scene", options.scenes, "A generated scene by name, or a .glb with roles; may be repeated");
  evaluate->add_option(
      "--group", options.groups,
      "All generated scenes of a group, as make-scenes --list names them (default: study, unless --scene is "
      "given); may be repeated");
  evaluate->add_option(
      "--tiles", options.tiles,
      "Folder of the tile set for the group tiles (default: the environment variable SIGHTLINE_TILES)");
  evaluate->add_option(
      "--motion", options.motion,
      "Folder of recorded motion for the group motion (default: the environment variable SIGHTLINE_MOTION)");
  std::vector<std::string> names;
  for (const sightline::PolicyEntry& policy : sightline::policies()) names.push_back(policy.name);
  evaluate
      ->add_option("--policy", options.policies,
                   "A camera policy; may be repeated. Default: all but the ceilings, cameras that know the whole scene "
                   "in advance. They "
                   "show what is possible at all, and take a few seconds for each second of a scene")
      ->check(CLI::IsMember(names));
  evaluate
      ->add_option("--settings", options.settings,
                   "NAME=JSON: a further policy, Sightline's step under these settings, e.g. "
                   "calm={\"settings\":{\"move_response_s\":0.4}}; proto/SETTINGS.md lists them; may be repeated")
      ->allow_extra_args(false);
  evaluate->add_option("--seeds", options.seeds, "Number of variants of each scene, with one seed after the other")
      ->check(CLI::Range(1, 100))
      ->capture_default_str();
  evaluate->add_option("--first-seed", options.first_seed, "The first of these seeds")->capture_default_str();
  evaluate->add_option("--rate", options.rate_hz, "Ticks a second of scenario time, hertz")
      ->check(CLI::Range(0.1, 1000.0))
      ->capture_default_str();
  evaluate->add_option("--duration", options.duration_s, "Seconds of each scene at most (default: all of it)")
      ->check(CLI::Range(0.0, 86400.0));
  evaluate->add_option("--truth-every", options.picture_every, "Re-render and judge every n-th frame")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  evaluate->add_flag("--sheets", options.sheets,
                     "Also draw eight pictures of each run as one image, in the folder's sheets/");
  evaluate->add_option("--jobs", options.jobs, "Threads (default: as many as there are cores)")
      ->check(CLI::Range(1, 1024));
  evaluate->add_option("--sampler", options.sampler, "What takes the maps of Sightline's own policies")
      ->check(CLI::IsMember({"embree", "egl"}))
      ->capture_default_str();
  evaluate->add_option("--out", options.out, "Folder for the tables")->capture_default_str();
  evaluate->add_flag("--json", options.json,
                     "One JSON object instead of a table: means over the seeds of every figure, by scene and policy");
}

}  // namespace

int main(int argc, char** argv) {
  sightline::prepare_software_rendering();
  CLI::App app("Sightline: a camera that keeps several targets in view", "sightline");
  app.set_version_flag("--version", "sightline " SIGHTLINE_VERSION);
  sightline::add_describe_flag(app);
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

  std::string scene;
  bool scene_json = false;
  CLI::App* scene_verb = app.add_subcommand("scene", "Print what a scene file contains");
  scene_verb->add_option("file", scene, "A .glb or .gltf")->required()->check(CLI::ExistingFile);
  scene_verb->add_flag("--json", scene_json, "One JSON object instead of tables");

  std::vector<sightline::Verb> verbs = sightline::add_recording_verbs(app);
  verbs.push_back(sightline::add_check_verb(app));
  verbs.push_back(sightline::add_demo_verb(app, bench.program));
  verbs.push_back(sightline::add_replay_verb(app));
  verbs.push_back(sightline::add_compare_verb(app));
  verbs.push_back(sightline::add_report_verb(app));
  verbs.push_back(sightline::add_shots_verb(app));
  verbs.push_back(sightline::add_status_verb(app));
  verbs.push_back(sightline::add_sessions_verb(app));
  verbs.push_back(sightline::add_top_verb(app));

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& stop) {
    return app.exit(stop) == 0 ? 0 : sightline::kWrongFlags;  // 0: --help or --version
  }
  for (const sightline::Verb& verb : verbs)
    if (verb.command->parsed()) return verb.run();
  if (app.got_subcommand("drive")) return sightline::run_drive_command(drive, std::cout, std::cerr);
  if (app.got_subcommand("evaluate")) return sightline::run_evaluate_command(evaluate, std::cout, std::cerr);
  if (app.got_subcommand("bench")) return sightline::run_bench_command(bench, std::cout, std::cerr);
  return sightline::run_scene_command(scene, std::cout, std::cerr, scene_json);
}
