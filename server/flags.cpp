#include "server/flags.h"

#include <CLI/CLI.hpp>
#include <filesystem>
#include <iostream>
#include <map>

#include "server/service/server_info.h"

namespace sightline {
namespace {

constexpr int kUsageError = 2;

// What the options write to, as text where the text needs more than a conversion.
struct RawFlags {
  Flags flags;
  std::string unix_mode = "0660";
  std::string sampler = "auto";
  std::string log_format = "text";
  std::string log_level = "info";
  std::string record = "all";
  bool print_config = false;
  bool check_config = false;
};

const std::map<std::string, SamplerChoice> kSamplers{
    {"auto", SamplerChoice::kAuto}, {"egl", SamplerChoice::kEgl}, {"embree", SamplerChoice::kEmbree}};
const std::map<std::string, LogFormat> kFormats{{"text", LogFormat::kText}, {"json", LogFormat::kJson}};
const std::map<std::string, LogLevel> kLevels{{"debug", LogLevel::kDebug},
                                              {"info", LogLevel::kInfo},
                                              {"warning", LogLevel::kWarning},
                                              {"error", LogLevel::kError},
                                              {"off", LogLevel::kOff}};

// Whether every session is recorded.
const std::map<std::string, bool> kRecorded{{"all", true}, {"asked", false}};

template <typename T>
CLI::IsMember one_of(const std::map<std::string, T>& choices) {
  std::vector<std::string> names;
  for (const auto& [name, value] : choices) names.push_back(name);
  return CLI::IsMember(names);
}

std::string check_octal_mode(const std::string& text) {
  const bool octal =
      !text.empty() && text.size() <= 4 && text.find_first_not_of("01234567") == std::string::npos;
  return octal && std::stoul(text, nullptr, 8) <= 0777 ? "" : "a file mode is octal, 0 to 0777; got " + text;
}

std::string check_address(const std::string& text) {
  if (text == "none") return "";
  const size_t colon = text.rfind(':');
  const std::string port = colon == std::string::npos ? "" : text.substr(colon + 1);
  const bool number =
      !port.empty() && port.size() <= 5 && port.find_first_not_of("0123456789") == std::string::npos;
  return colon > 0 && number && std::stoul(port) <= 65535 ? ""
                                                          : "an address is host:port or none; got " + text;
}

// A printed configuration has an empty one where none is set.
std::string check_folder(const std::string& path) {
  std::error_code unreadable;
  return path.empty() || std::filesystem::is_directory(path, unreadable) ? "" : "not a folder: " + path;
}

void add_listening(CLI::App& app, RawFlags& raw) {
  app.add_option("--listen", raw.flags.listen,
                 "TCP address host:port; port 0 takes a free one; none for no TCP")
      ->check(CLI::Validator(check_address, "HOST:PORT|none"))
      ->capture_default_str();
  app.add_option("--listen-unix", raw.flags.listen_unix, "Path of a unix socket, beside or instead of TCP")
      ->type_name("PATH");
  app.add_option("--unix-mode", raw.unix_mode, "File mode of the unix socket, octal")
      ->check(CLI::Validator(check_octal_mode, "MODE"))
      ->capture_default_str();
  app.add_option("--ready-file,--port-file", raw.flags.ready_file,
                 "File to write the addresses to, one a line, once clients can connect; removed at the stop")
      ->type_name("PATH");
}

void add_sampling(CLI::App& app, RawFlags& raw) {
  app.add_option("--scene-dir", raw.flags.scene_dir, "Folder of the scene files that sessions can name")
      ->check(CLI::Validator(check_folder, "DIR"));
  app.add_option(
         "--sampler", raw.sampler,
         "What takes depth maps: egl renders with OpenGL, embree casts rays on the CPU, auto takes egl "
         "where it renders in hardware and else embree")
      ->check(one_of(kSamplers))
      ->capture_default_str();
  app.add_option("--egl-device", raw.flags.egl_device,
                 "Index of the EGL device (see `sightlined devices`); -1 chooses")
      ->check(CLI::Range(-1, 1023))
      ->capture_default_str();
  app.add_flag("--require-gpu", raw.flags.require_gpu,
               "Refuse to start when OpenGL would render in software; embree itself needs no GPU");
}

void add_limits(CLI::App& app, RawFlags& raw) {
  app.add_option("--threads", raw.flags.threads,
                 "Threads that take steps; 0 for the CPUs that the process may use")
      ->check(CLI::Range(0u, 1024u))
      ->capture_default_str();
  app.add_option("--step-budget-ms", raw.flags.step_budget_ms,
                 "What a step may cost at most, ms; sessions whose steps cost more leave out a part of them. "
                 "0: a session's fair "
                 "share of the threads' time, and less than its tick interval")
      ->check(CLI::Range(0.0, 1000.0))
      ->capture_default_str();
  app.add_flag("--no-degrade", raw.flags.no_degrade,
               "Leave nothing out of any step: under overload sessions are answered less often instead");
  app.add_option("--max-sessions", raw.flags.max_sessions, "Sessions open at the same time; more are refused")
      ->check(CLI::Range(size_t{1}, size_t{100'000}))
      ->capture_default_str();
  app.add_option("--max-message-mib", raw.flags.max_message_mib,
                 "Largest message taken, MiB; larger ones end their call")
      ->check(CLI::Range(size_t{2}, size_t{1024}))
      ->capture_default_str();
  app.add_option("--max-upload-mib", raw.flags.max_upload_mib, "Largest scene file taken by upload, MiB")
      ->check(CLI::Range(size_t{1}, size_t{1024}))
      ->capture_default_str();
  app.add_option("--open-timeout-s", raw.flags.open_timeout_s,
                 "Seconds that a Control call gets to send `open` before it is ended")
      ->check(CLI::Range(0.01, 3600.0))
      ->capture_default_str();
  app.add_option("--upload-timeout-s", raw.flags.upload_timeout_s,
                 "Seconds that an upload may send nothing before it is ended")
      ->check(CLI::Range(0.01, 3600.0))
      ->capture_default_str();
  app.add_option("--drain-s", raw.flags.drain_s,
                 "Seconds that open sessions get to end after SIGTERM or SIGINT")
      ->check(CLI::Range(0.0, 3600.0))
      ->capture_default_str();
}

void add_logging(CLI::App& app, RawFlags& raw) {
  app.add_option("--log-format", raw.log_format,
                 "Log lines as text or as JSON objects, to the standard error output")
      ->check(one_of(kFormats))
      ->capture_default_str();
  app.add_option("--log-level", raw.log_level, "Least severe level that is logged")
      ->check(one_of(kLevels))
      ->capture_default_str();
}

void add_recording(CLI::App& app, RawFlags& raw) {
  constexpr uint64_t kMostMib = uint64_t{1} << 30;
  app.add_option("--record-dir", raw.flags.record_dir,
                 "Folder to record sessions into, a file each; made when it is not there. Without it nothing is recorded")
      ->type_name("DIR");
  app.add_option("--record", raw.record,
                 "Which sessions are recorded: all, unless their client says no, or those that are asked for")
      ->check(one_of(kRecorded))
      ->capture_default_str();
  app.add_flag("--record-scenes", raw.flags.record_scenes,
               "Put the scene files of a session into its recording; a client can also ask for it");
  app.add_option("--record-total-mib", raw.flags.record_total_mib,
                 "All recordings of the folder together, MiB; the oldest go")
      ->check(CLI::Range(uint64_t{1}, kMostMib))
      ->capture_default_str();
  app.add_option("--record-file-mib", raw.flags.record_file_mib,
                 "One file, MiB; then the session goes on in a next one")
      ->check(CLI::Range(uint64_t{1}, kMostMib))
      ->capture_default_str();
  app.add_option("--record-age-h", raw.flags.record_age_h, "Older recordings go, hours; 0: none for its age")
      ->check(CLI::Range(uint64_t{0}, uint64_t{1'000'000}))
      ->capture_default_str();
  app.add_option("--record-reserve-mib", raw.flags.record_reserve_mib,
                 "What recordings leave free on the disk, MiB; with less nothing is recorded")
      ->check(CLI::Range(uint64_t{0}, kMostMib))
      ->capture_default_str();
}

void add_configuration(CLI::App& app, RawFlags& raw) {
  app.set_config("--config", "", "Read flags from a file as --print-config writes it")->configurable(false);
  app.add_flag("--print-config", raw.print_config,
               "Print all flags with their values as a file for --config, and exit")
      ->configurable(false);
  app.add_flag("--check-config", raw.check_config, "Say whether the flags are valid, and exit")
      ->configurable(false);
  app.set_version_flag("--version", std::string("sightlined ") + kVersion, "Print the version and exit")
      ->configurable(false);
}

Flags finished(const RawFlags& raw) {
  Flags flags = raw.flags;
  flags.unix_mode = static_cast<unsigned>(std::stoul(raw.unix_mode, nullptr, 8));
  flags.sampler = kSamplers.at(raw.sampler);
  flags.log_format = kFormats.at(raw.log_format);
  flags.log_level = kLevels.at(raw.log_level);
  flags.record_all = kRecorded.at(raw.record);
  return flags;
}

}  // namespace

Command parse_command_line(int argc, const char* const* argv) {
  RawFlags raw;
  CLI::App app(
      "Steers cameras so that their targets stay in view: scenes and transforms in, poses out, over gRPC.",
      "sightlined");
  add_listening(app, raw);
  add_sampling(app, raw);
  add_limits(app, raw);
  add_logging(app, raw);
  add_recording(app, raw);
  add_configuration(app, raw);
  app.allow_config_extras(false);
  const CLI::App* devices =
      app.add_subcommand("devices", "Report what can take depth maps here, and which would be used")
          ->fallthrough()
          ->configurable(false);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return Exit{app.exit(error) == 0 ? 0 : kUsageError};
  }
  if (raw.print_config) {
    std::cout << app.config_to_str(true, true);
    return Exit{0};
  }
  if (raw.check_config) {
    std::cout << "the configuration is valid\n";
    return Exit{0};
  }
  if (devices->parsed()) return ReportDevices{finished(raw)};
  return Serve{finished(raw)};
}

}  // namespace sightline
