#include "client/demo/demo_command.h"

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <memory>

#include "client/base/process.h"
#include "client/drive/drive_command.h"
#include "scenes/catalog.h"

namespace sightline {
namespace {

using namespace std::chrono_literals;
namespace fs = std::filesystem;

// Enough to judge a run in a few seconds.
constexpr int kJudgedEvery = 10;

bool can_write(const fs::path& folder) {
  std::error_code trouble;
  fs::create_directories(folder, trouble);
  return !trouble && ::access(folder.c_str(), W_OK) == 0;
}

// Where the files go. A container's working folder often cannot be written, and its temporary folder can.
Result<fs::path> folder_for(const std::string& asked) {
  if (!asked.empty()) {
    if (can_write(asked)) return fs::path(asked);
    return fail(ErrorCode::kUnavailable, "--out", asked + " cannot be written by user " + std::to_string(::getuid()));
  }
  std::error_code none;
  for (const fs::path& folder : {fs::path("sightline-demo"), fs::temp_directory_path(none) / "sightline-demo"})
    if (can_write(folder)) return folder;
  return fail(ErrorCode::kUnavailable, "--out",
              "needs a folder that user " + std::to_string(::getuid()) + " can write");
}

Status write_file(const fs::path& path, const std::vector<std::byte>& bytes) {
  std::ofstream file(path, std::ios::binary);
  file.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  if (!file.flush()) return fail(ErrorCode::kUnavailable, path, "cannot be written");
  return {};
}

// A daemon on a free port of the loopback address. It ends with this process.
class DemoDaemon {
 public:
  static Result<DemoDaemon> start(const std::string& program, const std::string& sampler, const fs::path& folder) {
    const std::string ready = folder / "ready", log = folder / "daemon.log";
    std::error_code none;
    fs::remove(ready, none);
    fs::remove(log, none);
    auto process = ChildProcess::start(program,
                                       {"--listen", "127.0.0.1:0", "--sampler", sampler, "--ready-file", ready}, log);
    if (!process) return tl::unexpected(process.error());
    auto address = (*process)->wait_for_line(ready, 60s);
    if (!address) return tl::unexpected(address.error());
    return DemoDaemon(std::move(*process), std::move(*address));
  }
  const std::string& address() const { return address_; }

 private:
  DemoDaemon(std::unique_ptr<ChildProcess> process, std::string address)
      : process_(std::move(process)), address_(std::move(address)) {}

  std::unique_ptr<ChildProcess> process_;
  std::string address_;
};

Status play(const DemoOptions& options, std::ostream& out, std::ostream& err) {
  const auto folder = folder_for(options.out);
  if (!folder) return tl::unexpected(folder.error());
  const auto scene = scenes::find_scene(options.scene)->make({});
  if (!scene) return tl::unexpected(scene.error());
  DriveOptions drive;
  drive.scenario = *folder / (options.scene + ".glb");
  if (Status done = write_file(drive.scenario, *scene); !done) return done;
  const auto daemon = DemoDaemon::start(options.daemon, options.sampler, *folder);
  if (!daemon) return tl::unexpected(daemon.error());
  drive.server = daemon->address();
  drive.out = *folder;
  drive.page = *folder / (options.scene + ".html");
  drive.duration_s = options.duration_s;
  drive.lockstep = true;
  drive.picture_every = kJudgedEvery;
  drive.json = options.json;
  drive.progress = options.progress;
  if (run_drive_command(drive, out, err) != 0)
    return fail(ErrorCode::kUnavailable, "", "the scene was not played to its end");
  if (options.out.empty() && folder->is_absolute() && !options.json)
    out << "The working folder cannot be written, so the files are in " << folder->string()
        << ". In a container, mount a folder and give --out.\n";
  return {};
}

std::vector<std::string> scene_names() {
  std::vector<std::string> names;
  for (const scenes::CatalogEntry& entry : scenes::catalog())
    if (entry.group != scenes::SceneGroup::kTiles && entry.group != scenes::SceneGroup::kMotion)
      names.push_back(entry.name);
  return names;
}

}  // namespace

int run_demo_command(const DemoOptions& options, std::ostream& out, std::ostream& err) {
  const Status done = play(options, out, err);
  if (!done) err << "sightline demo: " << to_string(done.error()) << '\n';
  return done ? 0 : 1;
}

Verb add_demo_verb(CLI::App& app, const std::string& program) {
  auto options = std::make_shared<DemoOptions>();
  options->progress = isatty(STDERR_FILENO) != 0;
  options->daemon = fs::path(program).replace_filename("sightlined").string();
  CLI::App* demo = app.add_subcommand("demo",
                                      "Start a daemon, let it steer a camera through a generated scene, print how well "
                                      "it did, and write a page of the session");
  demo->add_option("--scene", options->scene, "A generated scene by name, for example rooms or hall")
      ->check(CLI::IsMember(scene_names()))
      ->capture_default_str();
  demo->add_option("--out", options->out,
                   "Folder for the page, the scene and the other files of sightline drive (default: sightline-demo in "
                   "the working folder, or "
                   "in the temporary folder when that cannot be written)");
  demo->add_option("--duration", options->duration_s, "Seconds of the scene to play")
      ->check(CLI::Range(0.1, 3600.0))
      ->capture_default_str();
  demo->add_option("--sampler", options->sampler, "As of sightlined: auto, egl or embree")
      ->check(CLI::IsMember({"auto", "egl", "embree"}))
      ->capture_default_str();
  demo->add_option("--daemon", options->daemon, "The program sightlined (default: beside this program)");
  demo->add_flag("--json", options->json,
                 "One JSON object at the end instead of text, as sightline drive --json prints it");
  return {demo, [options] { return run_demo_command(*options, std::cout, std::cerr); }};
}

}  // namespace sightline
