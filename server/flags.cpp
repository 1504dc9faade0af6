#include "server/flags.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <iostream>
#include <map>
#include <sstream>

#include "server/base/memory_budget.h"
#include "server/command_table.h"
#include "server/config_file.h"
#include "server/gate/small_file.h"
#include "server/service/server_info.h"

namespace sightline {
namespace {

constexpr int kUsageError = 2;

// The values that CLI11 fills in. Those that need more than a conversion are text.
struct RawFlags {
  Flags flags;
  std::string unix_mode = "0660";
  std::string sampler = "auto";
  std::string log_format = "text";
  std::string log_level = "info";
  std::string record = "all";
  std::string fault;
  std::string address;
  bool tls = false, alive = false;
  bool json = false;
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

// The values of --record; true: all sessions.
const std::map<std::string, bool> kRecorded{{"all", true}, {"asked", false}};

template <typename T>
CLI::IsMember one_of(const std::map<std::string, T>& choices) {
  std::vector<std::string> names;
  for (const auto& [name, value] : choices) names.push_back(name);
  return CLI::IsMember(names);
}

std::string check_octal_mode(const std::string& text) {
  const bool octal = !text.empty() && text.size() <= 4 && text.find_first_not_of("01234567") == std::string::npos;
  return octal && std::stoul(text, nullptr, 8) <= 0777 ? "" : "a file mode is octal, 0 to 0777; got " + text;
}

std::string check_address(const std::string& text) {
  if (text == "none") return "";
  const size_t colon = text.rfind(':');
  const std::string port = colon == std::string::npos ? "" : text.substr(colon + 1);
  const bool number = !port.empty() && port.size() <= 5 && port.find_first_not_of("0123456789") == std::string::npos;
  return colon > 0 && number && std::stoul(port) <= 65535 ? "" : "an address is host:port or none; got " + text;
}

// An empty path is valid: a printed configuration has one where no folder is set.
std::string check_folder(const std::string& path) {
  std::error_code unreadable;
  return path.empty() || std::filesystem::is_directory(path, unreadable) ? "" : "not a folder: " + path;
}

// CLI::Range lets "nan" through.
CLI::Validator number_in(double least, double most) {
  std::ostringstream range;
  range << least << " to " << most;
  const auto check = [=, text = range.str()](const std::string& value) {
    double number = 0.0;
    const bool ok = CLI::detail::lexical_cast(value, number) && number >= least && number <= most;
    return ok ? "" : "a number from " + text + " is needed; got " + value;
  };
  return CLI::Validator(check, "NUMBER " + range.str());
}

void add_listening(CLI::App& app, RawFlags& raw) {
  app.add_option(
         "--listen", raw.flags.listen,
         "TCP address to listen at, host:port. Port 0 takes a free port; none turns TCP off. Change it to serve "
         "other machines, which needs --tls-cert with --access-file or --tls-client-ca")
      ->check(CLI::Validator(check_address, "HOST:PORT|none"))
      ->capture_default_str();
  app.add_option("--listen-unix", raw.flags.listen_unix,
                 "Path of a unix socket to listen at, in addition to TCP. It answers faster than TCP to clients on the "
                 "same machine. Default: no socket")
      ->type_name("PATH");
  app.add_option("--unix-mode", raw.unix_mode,
                 "File mode of the unix socket, octal. Change it to decide which users can connect")
      ->check(CLI::Validator(check_octal_mode, "MODE"))
      ->capture_default_str();
  app.add_option("--ready-file,--port-file", raw.flags.ready_file,
                 "File that appears once clients can connect, with one address a line; removed when the daemon stops. "
                 "Use it in scripts that start the daemon. Default: no file")
      ->type_name("PATH");
}

void add_trust(CLI::App& app, RawFlags& raw) {
  app.add_option(
         "--tls-cert", raw.flags.tls_cert,
         "File of the server's certificate, in PEM format, followed by those between it and its root. TCP is then "
         "encrypted. It is read again when it changes. Default: TCP is not encrypted")
      ->type_name("FILE");
  app.add_option("--tls-key", raw.flags.tls_key, "File of the certificate's key, in PEM format, without a password")
      ->type_name("FILE");
  app.add_option("--tls-client-ca", raw.flags.tls_client_ca,
                 "File of the certificates, in PEM format, of which one must have signed the certificate of every "
                 "client that connects "
                 "over TCP. Default: clients need no certificate")
      ->type_name("FILE");
  app.add_option("--access-file", raw.flags.access_file,
                 "File of those who may speak: tokens, certificates and users of the unix socket, each with a role. It "
                 "is read again when "
                 "it changes. Default: everyone who can connect may speak")
      ->type_name("FILE");
  app.add_flag("--allow-insecure-network", raw.flags.allow_insecure_network,
               "Listen at an address that other hosts can reach although clients need not show who they are, or are "
               "not encrypted. Use "
               "it only where something else keeps others out");
}

void add_health(CLI::App& app, RawFlags& raw) {
  app.add_option(
         "--metrics-listen", raw.flags.metrics_listen,
         "TCP address for Prometheus and for probes, host:port: /metrics, /livez and /readyz over HTTP. It has neither "
         "encryption nor "
         "authentication, so choose an address that only they can reach, such as 127.0.0.1:50152. none turns it off")
      ->check(CLI::Validator(check_address, "HOST:PORT|none"))
      ->capture_default_str();
  app.add_option("--stall-s", raw.flags.stall_s,
                 "Time after which a thread that does not answer counts as hanging, in seconds. The daemon is then "
                 "neither alive nor "
                 "ready. Raise it on machines that stop for long")
      ->check(number_in(1.0, 3600.0))
      ->capture_default_str();
}

void add_sampling(CLI::App& app, RawFlags& raw) {
  app.add_option("--scene-dir", raw.flags.scene_dir,
                 "Folder of the scene files that clients can open by name. Default: none; scenes are then uploaded")
      ->check(CLI::Validator(check_folder, "DIR"));
  app.add_option("--sampler", raw.sampler,
                 "Device that takes depth maps. egl renders with OpenGL, embree casts rays on the CPU. auto takes "
                 "embree, which was "
                 "faster on every machine measured, and egl where --egl-device or --require-gpu asks for it")
      ->check(one_of(kSamplers))
      ->capture_default_str();
  app.add_option("--egl-device", raw.flags.egl_device,
                 "Index of the EGL device, as `sightlined devices` lists them; -1 chooses. Change it on a machine with "
                 "several GPUs")
      ->check(CLI::Range(-1, 1023))
      ->capture_default_str();
  app.add_flag("--require-gpu", raw.flags.require_gpu,
               "Render with OpenGL, and refuse to start when that would be in software. Use it where a silent fallback "
               "would be a "
               "misconfiguration. --sampler embree needs no GPU and is not affected");
}

void add_limits(CLI::App& app, RawFlags& raw) {
  app.add_option(
         "--threads", raw.flags.threads,
         "Threads that take steps; 0 means one for each CPU that the process may use. Lower it to leave CPUs to "
         "a game server on the same machine")
      ->check(CLI::Range(0u, 1024u))
      ->capture_default_str();
  app.add_option(
         "--step-budget-ms", raw.flags.step_budget_ms,
         "Longest time that a step may take, in milliseconds. A session whose steps take longer lowers its "
         "quality level. 0 means no fixed limit: the session's fair share of the threads, and less than its tick "
         "interval. Set it to bound the cost of each session")
      ->check(number_in(0.0, 1000.0))
      ->capture_default_str();
  app.add_flag("--no-degrade", raw.flags.no_degrade,
               "Never lower the quality level of a session. Under overload ticks are merged instead, so sessions are "
               "answered less often. Use it when every reply must have full quality");
  app.add_option("--max-sessions", raw.flags.max_sessions,
                 "Largest number of open sessions; further ones are refused. Change it to fit the machine")
      ->check(CLI::Range(size_t{1}, size_t{100'000}))
      ->capture_default_str();
  app.add_option(
         "--max-sessions-per-client", raw.flags.max_sessions_per_client,
         "Largest number of open sessions of one client; 0 means three quarters of --max-sessions, so that others get "
         "in. A "
         "client is a user on the unix socket, otherwise an address. Raise it where one client opens all sessions")
      ->check(CLI::Range(size_t{0}, size_t{100'000}))
      ->capture_default_str();
  app.add_option(
         "--session-idle-s", raw.flags.session_idle_s,
         "Time without a tick after which a session is ended, in seconds; 0 means never. Raise it for games that pause "
         "for longer")
      ->check(number_in(0.0, 86'400.0))
      ->capture_default_str();
  app.add_option("--resume-grace-s", raw.flags.resume_grace_s,
                 "Time for which a session is kept after its stream broke, in seconds, if its client asked for it. In "
                 "this time the client "
                 "can go on with it over another connection. It counts as an open session until then. 0 means that no "
                 "session is kept")
      ->check(number_in(0.0, 3600.0))
      ->capture_default_str();
  app.add_option("--max-connections", raw.flags.max_connections,
                 "Largest number of open connections. An unused one makes way for a new one. It is lowered when the "
                 "process may "
                 "not open three file descriptors for each")
      ->check(CLI::Range(size_t{1}, size_t{100'000}))
      ->capture_default_str();
  app.add_option("--max-connections-per-client", raw.flags.max_connections_per_client,
                 "Largest number of open connections of one client; 0 means three quarters of --max-connections")
      ->check(CLI::Range(size_t{0}, size_t{100'000}))
      ->capture_default_str();
  app.add_option("--max-health-watches", raw.flags.max_health_watches,
                 "Largest number of Watch calls of the health service, three quarters of them for one client. A client "
                 "needs one for each "
                 "connection, so raise it together with --max-connections")
      ->check(CLI::Range(size_t{1}, size_t{100'000}))
      ->capture_default_str();
  app.add_option("--max-reflection-calls", raw.flags.max_reflection_calls,
                 "Largest number of reflection calls at the same time, of 10 s each. Tools such as grpcurl make them; "
                 "raise it when very many do")
      ->check(CLI::Range(size_t{1}, size_t{1000}))
      ->capture_default_str();
  app.add_option(
         "--max-message-mib", raw.flags.max_message_mib,
         "Largest message that is accepted, in MiB; a larger one ends its call. Raise it for ticks with very many "
         "instances")
      ->check(CLI::Range(size_t{2}, size_t{1024}))
      ->capture_default_str();
  app.add_option("--max-message-memory-mib", raw.flags.max_message_memory_mib,
                 "Largest memory that one message may take when it is parsed, in MiB; a larger one ends its call. In a "
                 "small container the default is smaller")
      ->check(CLI::Range(size_t{8}, size_t{4096}))
      ->capture_default_str();
  app.add_option("--session-memory-mib", raw.flags.session_memory_mib,
                 "Largest memory of one session, in MiB: its instances, their distinct shapes, and what its steps "
                 "keep. An instance takes about 400 bytes, a "
                 "distinct sphere or capsule 20 KB, the steps 0.5 MiB and 0.23 MiB for each target with the default "
                 "settings. Raise it for very "
                 "large scenes. In a small container the default is smaller")
      ->check(CLI::Range(size_t{1}, size_t{100'000}))
      ->capture_default_str();
  app.add_option("--sessions-memory-mib", raw.flags.sessions_memory_mib,
                 "The same for all sessions together. In a small container the default is smaller")
      ->check(CLI::Range(size_t{1}, size_t{1'000'000}))
      ->capture_default_str();
  app.add_option("--client-memory-mib", raw.flags.client_memory_mib,
                 "The same for all sessions of one client; 0 means three quarters of --sessions-memory-mib, so that "
                 "others get in")
      ->check(CLI::Range(size_t{0}, size_t{1'000'000}))
      ->capture_default_str();
  app.add_option("--geometry-memory-mib", raw.flags.geometry_memory_mib,
                 "Largest memory of the geometry of all scenes and shapes together, in MiB. It also bounds what one "
                 "scene file may take. "
                 "The sampler takes about as much again. Raise it for larger scenes. In a container with less than "
                 "1,120 MiB of memory (memory.max of its "
                 "control group) the default is smaller. So is that of the other flags of memory, so that all of them "
                 "fit together; --print-config "
                 "shows them")
      ->check(CLI::Range(size_t{8}, size_t{1'000'000}))
      ->capture_default_str();
  app.add_option("--client-scenes-memory-mib", raw.flags.client_scenes_memory_mib,
                 "Largest memory of the scenes that one client has uploaded, in MiB; 0 means three quarters of "
                 "--geometry-memory-mib, so that "
                 "others can upload too")
      ->check(CLI::Range(size_t{0}, size_t{1'000'000}))
      ->capture_default_str();
  app.add_option("--messages-memory-mib", raw.flags.messages_memory_mib,
                 "Memory of the messages that wait, of all sessions together, in MiB; half of it for one client. "
                 "Beyond it the server reads "
                 "less, and refuses large messages. It must hold twice --max-message-memory-mib. In a small container "
                 "the default is smaller")
      ->check(CLI::Range(size_t{16}, size_t{1'000'000}))
      ->capture_default_str();
  app.add_option("--transport-memory-mib", raw.flags.transport_memory_mib,
                 "Memory of gRPC for messages that are not complete, or that nobody has taken yet, of all clients "
                 "together, in MiB; half of it "
                 "for one client; 0 means no limit. Beyond it the connection that holds most is cut. Raise it where "
                 "many clients send large "
                 "messages at once. In a small container the default is smaller")
      ->check(CLI::Range(size_t{0}, size_t{1'000'000}))
      ->capture_default_str();
  app.add_option("--max-step-cost-ms", raw.flags.max_step_cost_ms,
                 "Largest cost of a step that a client may ask for by its settings and its targets, in milliseconds of "
                 "an ordinary CPU "
                 "as the server estimates it; 0 means no limit. A step cannot be interrupted, so others wait for that "
                 "long. Raise it "
                 "where one client uses the server alone")
      ->check(number_in(0.0, 100'000.0))
      ->capture_default_str();
  app.add_option("--max-maps-ms", raw.flags.max_maps_ms,
                 "Longest processor time that the depth maps of a step may take, in milliseconds; 0 means no limit. A "
                 "step that takes longer is given "
                 "up, and its client is told. It bounds what a heavy scene can cost others; with EGL the maps are "
                 "taken in one go")
      ->check(number_in(0.0, 100'000.0))
      ->capture_default_str();
  app.add_option("--max-load-s", raw.flags.max_load_s,
                 "Longest processor time that reading one scene file may take, or the opening of one session, in "
                 "seconds; 0 means no limit. "
                 "A file that takes longer is refused. Raise it for larger scenes, or slow machines")
      ->check(number_in(0.0, 100'000.0))
      ->capture_default_str();
  app.add_option(
         "--max-upload-mib", raw.flags.max_upload_mib,
         "Largest scene file that can be uploaded, in MiB. Raise it for larger scenes; a file is held in memory "
         "while it is read. In a small container the default is smaller")
      ->check(CLI::Range(size_t{1}, size_t{1024}))
      ->capture_default_str();
  app.add_option("--max-uploads", raw.flags.max_uploads,
                 "Largest number of uploads at the same time, half of them for one client. Together they hold at most "
                 "twice --max-upload-mib. A very slow one "
                 "makes way for a new one")
      ->check(CLI::Range(size_t{1}, size_t{48}))
      ->capture_default_str();
  app.add_option("--kept-uploads-mib", raw.flags.kept_uploads_mib,
                 "Memory for uploaded scenes that no session has opened yet, in MiB; beyond it the oldest is dropped. "
                 "In a small "
                 "container the default is smaller")
      ->check(CLI::Range(size_t{1}, size_t{100'000}))
      ->capture_default_str();
  app.add_option("--open-timeout-s", raw.flags.open_timeout_s,
                 "Time in which a Control call must send `open`, in seconds; otherwise it is ended. Raise it for slow "
                 "networks")
      ->check(number_in(0.01, 3600.0))
      ->capture_default_str();
  app.add_option(
         "--upload-timeout-s", raw.flags.upload_timeout_s,
         "Longest pause within an upload, in seconds; after that the upload is ended. Raise it for slow networks")
      ->check(number_in(0.01, 3600.0))
      ->capture_default_str();
  app.add_option("--drain-s", raw.flags.drain_s,
                 "Time that clients get to close their sessions after SIGTERM or SIGINT, in seconds. Keep it below the "
                 "time after which the platform kills the process")
      ->check(number_in(0.0, 3600.0))
      ->capture_default_str();
}

void add_logging(CLI::App& app, RawFlags& raw) {
  app.add_option(
         "--log-format", raw.log_format,
         "Format of the log, which goes to the standard error output: text, or one JSON object a line. Use json "
         "for log collectors")
      ->check(one_of(kFormats))
      ->capture_default_str();
  app.add_option("--log-level", raw.log_level,
                 "Least severe level that is logged. Use debug to see why ticks are refused")
      ->check(one_of(kLevels))
      ->capture_default_str();
}

void add_recording(CLI::App& app, RawFlags& raw) {
  constexpr uint64_t kMostMib = uint64_t{1} << 30;
  app.add_option(
         "--record-dir", raw.flags.record_dir,
         "Folder in which sessions are recorded, one file each; created when it does not exist. Default: nothing "
         "is recorded")
      ->type_name("DIR");
  app.add_option("--record", raw.record,
                 "Sessions to record: all except those whose client refuses, or only those whose client asks (asked)")
      ->check(one_of(kRecorded))
      ->capture_default_str();
  app.add_flag("--record-scenes", raw.flags.record_scenes,
               "Put the scene files of each session into its recording, which can then be replayed anywhere. A client "
               "can also ask for it");
  app.add_option("--record-total-mib", raw.flags.record_total_mib,
                 "Largest size of all recordings together, in MiB; beyond it the oldest are deleted")
      ->check(CLI::Range(uint64_t{1}, kMostMib))
      ->capture_default_str();
  app.add_option("--record-file-mib", raw.flags.record_file_mib,
                 "Largest size of one file, in MiB; a longer session continues in further files")
      ->check(CLI::Range(uint64_t{1}, kMostMib))
      ->capture_default_str();
  app.add_option(
         "--record-age-h", raw.flags.record_age_h,
         "Age at which a recording is deleted, in hours; 0 means never. Set it where recordings may be kept for a "
         "limited time only")
      ->check(CLI::Range(uint64_t{0}, uint64_t{1'000'000}))
      ->capture_default_str();
  app.add_option("--record-reserve-mib", raw.flags.record_reserve_mib,
                 "Free space that recordings leave on the disk, in MiB; with less, nothing is recorded")
      ->check(CLI::Range(uint64_t{0}, kMostMib))
      ->capture_default_str();
}

// These flags are for tests, so --help leaves them out.
void add_drills(CLI::App& app, RawFlags& raw) {
  const auto check = [](const std::string& text) {
    const auto plan = parse_fault_plan(text);
    return plan ? std::string() : to_string(plan.error());  // CLI11 does not name a hidden flag
  };
  app.add_option("--inject-fault", raw.fault, "Let each N-th call for depth maps meet a fault")
      ->check(CLI::Validator(check, "KIND:N"))
      ->configurable(false)
      ->group("");
}

void add_configuration(CLI::App& app, RawFlags& raw) {
  const auto check_file = [](const std::string& path) {
    const auto text = read_small_file(path, "");
    return text ? std::string() : text.error().message;
  };
  app.set_config(
         "--config", "",
         "File to read flags from, in the format of --print-config; the command line wins. It has at most 1 MiB")
      ->check(CLI::Validator(check_file, ""))
      ->type_name("FILE")
      ->configurable(false);
  app.add_flag("--print-config", raw.print_config,
               "Print all flags with their values in the format of --config, and exit")
      ->configurable(false);
  app.add_flag("--check-config", raw.check_config,
               "Try whether the daemon can start with these flags on this machine, and exit: 0 when it can, otherwise "
               "2. It reads the files that the flags "
               "name and makes the device, but takes no address")
      ->configurable(false);
  app.set_version_flag("--version", std::string("sightlined ") + kVersion, "Print the version and exit")
      ->configurable(false);
  add_describe_flag(app);
}

// Where a control group limits the memory, flags that are not set get a default that fits.
void fit_memory(CLI::App& app, Flags& flags, const MemoryBudgets& budgets) {
  const auto fit = [&](const char* name, size_t& value, size_t fitting) {
    CLI::Option& option = *app.get_option(name);
    if (option.count() > 0) return;
    value = fitting;
    option.default_str(std::to_string(fitting));
  };
  fit("--geometry-memory-mib", flags.geometry_memory_mib, budgets.geometry);
  fit("--sessions-memory-mib", flags.sessions_memory_mib, budgets.sessions);
  fit("--session-memory-mib", flags.session_memory_mib, budgets.session);
  fit("--max-message-memory-mib", flags.max_message_memory_mib, budgets.max_message_memory);
  // A message that is allowed to be larger needs its room.
  const size_t most = MemoryBudgets().messages;
  fit("--messages-memory-mib", flags.messages_memory_mib,
      std::max(budgets.messages, std::min(2 * flags.max_message_memory_mib, most)));
  fit("--max-upload-mib", flags.max_upload_mib, budgets.max_upload);
  fit("--kept-uploads-mib", flags.kept_uploads_mib, budgets.kept_uploads);
  // One client, which has half of it, can send a message of the largest size.
  fit("--transport-memory-mib", flags.transport_memory_mib,
      std::max(budgets.transport, 2 * (flags.max_message_mib + 1)));
}

// Throws CLI::ValidationError for flags that are wrong only together.
void check_together(const Flags& flags) {
  if (flags.listen == "none" && flags.listen_unix.empty())
    throw CLI::ValidationError("--listen", "none needs --listen-unix: there is no address to listen at");
  if (flags.messages_memory_mib < 2 * flags.max_message_memory_mib)
    throw CLI::ValidationError("--messages-memory-mib", "must be at least twice --max-message-memory-mib");
  if (flags.transport_memory_mib > 0 && flags.transport_memory_mib < 2 * (flags.max_message_mib + 1))
    throw CLI::ValidationError("--transport-memory-mib", "must be at least twice --max-message-mib and 2 more, or 0");
  if (flags.tls_cert.empty() != flags.tls_key.empty())
    throw CLI::ValidationError(flags.tls_cert.empty() ? "--tls-key" : "--tls-cert",
                               "--tls-cert and --tls-key are needed together");
  if (flags.tls_cert.empty() && !flags.tls_client_ca.empty())
    throw CLI::ValidationError("--tls-client-ca", "needs --tls-cert");
  if (flags.tls_cert.empty() && !flags.access_file.empty() && flags.listen != "none")
    throw CLI::ValidationError("--access-file",
                               "needs --tls-cert, or --listen none: a token that is sent unencrypted is no secret");
}

// Throws CLI::ValidationError for a value that --print-config cannot write.
void check_printable(const CLI::App& app) {
  for (const CLI::Option* option : app.get_options()) {
    if (!option->get_configurable()) continue;
    for (const std::string& value : option->results())
      if (const std::string why = why_not_in_file(value); !why.empty())
        throw CLI::ValidationError(option->get_name(), why);
  }
}

Flags finished(const RawFlags& raw) {
  Flags flags = raw.flags;
  flags.unix_mode = static_cast<unsigned>(std::stoul(raw.unix_mode, nullptr, 8));
  flags.sampler = kSamplers.at(raw.sampler);
  flags.log_format = kFormats.at(raw.log_format);
  flags.log_level = kLevels.at(raw.log_level);
  flags.record_all = kRecorded.at(raw.record);
  if (!raw.fault.empty()) flags.fault = parse_fault_plan(raw.fault).value_or(FaultPlan{});
  return flags;
}

void add_devices(CLI::App& app, RawFlags& raw) {
  CLI::App* const
      devices = app.add_subcommand(
                       "devices",
                       "List the devices that can take depth maps on this machine, and the one that would be used")
                    ->fallthrough()
                    ->configurable(false);
  devices->add_flag("--json", raw.json, "One JSON object instead of a table")->configurable(false);
}

// Its flags, --help among them, are those of `sightline demo`.
void add_demo(CLI::App& app) {
  app.add_subcommand("demo", "Play a generated scene and write a page of the session, as `sightline demo` does")
      ->prefix_command()
      ->configurable(false)
      ->set_help_flag();
}

void add_health_check(CLI::App& app, RawFlags& raw) {
  CLI::App* const
      health = app.add_subcommand(
                      "healthcheck",
                      "Ask the running daemon whether it is ready, at the address that --listen-unix, --listen or "
                      "the file of --config name. Exit with 0 when it is, otherwise with 1; for probes that run a "
                      "command")
                   ->fallthrough()
                   ->configurable(false);
  health->add_option("--address", raw.address, "Where the daemon listens, instead: host:port, or unix:PATH")
      ->configurable(false);
  health
      ->add_flag(
          "--tls", raw.tls,
          "Encrypt TCP, for a daemon with --tls-cert whose flags are not given here; its certificate is not verified")
      ->configurable(false);
  health->add_flag("--live", raw.alive, "Ask whether it is alive instead: whether none of its threads hangs")
      ->configurable(false);
}

}  // namespace

// All flags and subcommands. `app` has references to `raw`.
struct CommandLine::Parts {
  RawFlags raw;
  CLI::App app{
      "Steers cameras so that their targets stay in view. Clients send scenes and transforms over gRPC and "
      "receive camera poses.",
      "sightlined"};
  const std::shared_ptr<ConfigFile> config = std::make_shared<ConfigFile>(app);
  const MemoryBudgets budgets = memory_budgets(memory_limit(own_control_groups()));

  Parts();
  // What the command line asks for, once it has been parsed.
  Command command();
};

CommandLine::Parts::Parts() {
  add_listening(app, raw);
  add_trust(app, raw);
  add_health(app, raw);
  add_sampling(app, raw);
  add_limits(app, raw);
  add_logging(app, raw);
  add_recording(app, raw);
  add_drills(app, raw);
  add_configuration(app, raw);
  app.allow_config_extras(false);
  app.config_formatter(config);
  add_devices(app, raw);
  add_demo(app);
  add_health_check(app, raw);
}

Command CommandLine::Parts::command() {
  if (app.got_subcommand("demo")) return BecomeDemo{app.get_subcommand("demo")->remaining()};
  fit_memory(app, raw.flags, budgets);
  const bool devices = app.got_subcommand("devices");
  if (raw.check_config || (!devices && !raw.print_config)) check_together(raw.flags);
  if (raw.print_config) {
    check_printable(app);
    std::cout << app.config_to_str(true, true);
    return Exit{0};
  }
  if (raw.check_config) return CheckConfig{finished(raw)};
  if (devices) return ReportDevices{finished(raw), raw.json};
  if (app.got_subcommand("healthcheck")) return CheckHealth{finished(raw), raw.address, raw.tls, raw.alive};
  return Serve{finished(raw)};
}

CommandLine::CommandLine() : parts_(std::make_unique<Parts>()) {}
CommandLine::~CommandLine() = default;

Command CommandLine::parse(int argc, const char* const* argv) {
  parts_->raw = RawFlags{};
  parts_->config->forget();
  try {
    parts_->app.parse(argc, argv);
    return parts_->command();
  } catch (const CLI::ValidationError& error) {
    const CLI::ValidationError placed("", error.what() + parts_->config->place_of(error.what()));
    parts_->app.exit(placed);
    return Exit{kUsageError};
  } catch (const CLI::ParseError& error) {
    return Exit{parts_->app.exit(error) == 0 ? 0 : kUsageError};
  }
}

Command parse_command_line(int argc, const char* const* argv) {
  return CommandLine().parse(argc, argv);
}

}  // namespace sightline
