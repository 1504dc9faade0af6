// sightlined: flags -> parts wired by hand -> run -> orderly stop.
#include <grpcpp/grpcpp.h>
#include <malloc.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iostream>
#include <memory>
#include <new>
#include <optional>
#include <system_error>
#include <thread>

#include "server/base/cpu_budget.h"
#include "server/device_report.h"
#include "server/flags.h"
#include "server/gl/software_renderer.h"
#include "server/health_check.h"
#include "server/metrics/operator_pages.h"
#include "server/preparation.h"
#include "server/record/recorder.h"
#include "server/sample/embree_sampler.h"
#include "server/sample/sampler_choice.h"
#include "server/service/last_resort.h"
#include "server/service/listener.h"
#include "server/service/self_test.h"
#include "server/service/server_info.h"
#include "server/service/service.h"
#include "server/service/watchdog.h"
#include "server/service_manager.h"
#include "server/signals.h"

namespace sightline {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

// One event loop moves about 20,000 ticks a second, which is more than eight threads can step.
constexpr unsigned kThreadsPerLoop = 8;
// More than one, since one client has at most all but one: others can open sessions, and small files can be read, while
// its large ones are.
constexpr unsigned kLoaderThreads = 3, kUploaderThreads = 2;
// Steps and openings come before uploads, which can wait.
constexpr int kUploaderNiceness = 5;
// Time that open calls get to end after the sessions were closed.
constexpr milliseconds kStopGrace{500};
// Time from then on until all parts of the daemon have ended. Together with LastResort::kRescueTime and the default of
// --drain-s it is less than what systemd and Compose allow (15 s).
constexpr std::chrono::seconds kLongestEnd{4};
// How often the end of the sessions is checked while the server drains.
constexpr milliseconds kDrainPoll{10};
// Of each connection: the client's socket, and a pair between the gate and gRPC.
constexpr size_t kDescriptorsOfConnection = 3;
// For everything else: the log, listeners, scene files, threads' queues, devices.
constexpr size_t kDescriptorReserve = 128;
constexpr rlim_t kDescriptorsWanted = 65'536;
// How often freed memory is given back to the system, and changed credentials are looked for.
constexpr std::chrono::seconds kTidyPeriod{10};
// How soon changed credentials are looked at again that have not settled yet.
constexpr milliseconds kSettlePoll{250};
// Larger blocks, such as the largest messages, come straight from the system and go straight back. Without a fixed size
// the allocator learns from the first large message to keep several megabytes for each thread, which malloc_trim does
// not give back.
constexpr int kLargeBlock = 1 << 20;
// From which amount on memory is given back.
constexpr size_t kWorthTrimming = size_t{4} << 20;
// How often the queues of recorded sessions are written to the disk.
constexpr milliseconds kRecordPeriod{50};

// Runs before any thread starts, because threads inherit the signal mask and libraries read the environment once.
void prepare_process() {
  ::mallopt(M_MMAP_THRESHOLD, kLargeBlock);
  take_over_signals();
  prepare_software_rendering();
  // gRPC's own log lines have another format. Everything that matters comes back as an error or a status.
  setenv("GRPC_VERBOSITY", "NONE", 0);
}

// A quarter of all places is left for other clients.
size_t share_of_one(size_t asked, size_t all) {
  return asked > 0 ? asked : all - all / 4;
}

// Raises the limit of file descriptors as far as the process may, and returns it.
size_t raise_descriptor_limit() {
  rlimit limit{};
  if (::getrlimit(RLIMIT_NOFILE, &limit) != 0) return 1024;
  limit.rlim_cur = std::min<rlim_t>(limit.rlim_max, kDescriptorsWanted);
  ::setrlimit(RLIMIT_NOFILE, &limit);
  ::getrlimit(RLIMIT_NOFILE, &limit);
  return limit.rlim_cur;
}

GateLimits gate_limits(const Flags& flags) {
  const size_t recordings = flags.record_dir.empty() ? 0 : flags.max_sessions;
  const size_t operators = flags.metrics_listen == "none" ? 0 : HttpPort::kMostConnections;
  const size_t descriptors = raise_descriptor_limit(), others = kDescriptorReserve + recordings + operators;
  const size_t fit = descriptors > others ? (descriptors - others) / kDescriptorsOfConnection : 0;
  GateLimits limits;
  limits.max_connections = std::clamp<size_t>(fit, 1, flags.max_connections);
  limits.max_per_client = share_of_one(flags.max_connections_per_client, limits.max_connections);
  limits.held_bytes = flags.transport_memory_mib << 20;
  return limits;
}

ListenOptions listen_options(const Flags& flags, unsigned threads, const Credentials& credentials, const Log& log) {
  ListenOptions options = listen_addresses(flags, credentials);
  options.max_message_bytes = flags.max_message_mib << 20;
  options.max_health_watches = flags.max_health_watches;
  options.max_reflection_calls = flags.max_reflection_calls;
  options.gate = gate_limits(flags);
  options.on_refused = [&log](const std::string& client, std::string_view reason) {
    log.warn("connection refused", {{"client", client}, {"reason", std::string(reason)}});
  };
  options.loops = (threads + kThreadsPerLoop - 1) / kThreadsPerLoop;
  return options;
}

ServiceLimits service_limits(const Flags& flags) {
  ServiceLimits limits;
  limits.max_message_bytes = flags.max_message_mib << 20;
  limits.max_message_memory = flags.max_message_memory_mib << 20;
  limits.messages_memory = flags.messages_memory_mib << 20;
  limits.max_uploads = flags.max_uploads;
  limits.session_idle = milliseconds(std::lround(flags.session_idle_s * 1e3));
  limits.resume_grace = milliseconds(std::lround(flags.resume_grace_s * 1e3));
  limits.max_upload_bytes = flags.max_upload_mib << 20;
  limits.open_timeout = milliseconds(std::lround(flags.open_timeout_s * 1e3));
  limits.upload_timeout = milliseconds(std::lround(flags.upload_timeout_s * 1e3));
  return limits;
}

BudgetRules budget_rules(const Flags& flags) {
  BudgetRules rules;
  rules.degrade = !flags.no_degrade;
  if (flags.step_budget_ms > 0) rules.fixed_ns = std::llround(flags.step_budget_ms * 1e6);
  return rules;
}

uint64_t wall_ns() {
  return static_cast<uint64_t>(
      std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::system_clock::now().time_since_epoch())
          .count());
}

RecordSettings record_settings(const Flags& flags) {
  RecordSettings settings;
  settings.folder = flags.record_dir;
  settings.limits = {.max_total_bytes = flags.record_total_mib << 20,
                     .max_file_bytes = flags.record_file_mib << 20,
                     .max_age_s = flags.record_age_h * 3600,
                     .free_reserve_bytes = flags.record_reserve_mib << 20};
  return settings;
}

void log_warning(const Log& log, const RecordWarning& warning) {
  const Log::Field session{"session", warning.session_id}, reason{"reason", warning.text};
  warning.over ? log.info("recording recovered", {session, reason}) : log.warn("recording degraded", {session, reason});
}

// The recording of sessions. All recorders must be gone before it is destroyed, which completes the files.
class Recording {
 public:
  Recording(const Flags& flags, const Log& log)
      : files_(system_files()),
        writer_(record_settings(flags), *files_, wall_ns, [&log](const RecordWarning& w) { log_warning(log, w); }),
        thread_(std::in_place, started(writer_), kRecordPeriod) {}

  RecordWriter& writer() { return writer_; }
  // Completes the files although sessions are still recorded, which lose what comes now.
  void complete() {
    thread_.reset();
    writer_.finish();
  }

 private:
  static RecordWriter& started(RecordWriter& writer) {
    writer.try_folder();
    return writer;
  }

  const std::unique_ptr<RecordFileSystem> files_;
  RecordWriter writer_;
  std::optional<RecordThread> thread_;
};

// A prefix that differs for each start of a daemon, so that a session id in a log never means two sessions.
std::string start_name() {
  char text[32];
  std::snprintf(text, sizeof(text), "%08lx%x", static_cast<unsigned long>(std::time(nullptr)),
                static_cast<unsigned>(getpid()) & 0xFFFu);
  return text;
}

int64_t monotonic_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(steady_clock::now().time_since_epoch()).count();
}

std::string joined(const std::vector<std::string>& words, const char* separator) {
  std::string text;
  for (const std::string& word : words) text.append(text.empty() ? "" : separator).append(word);
  return text;
}

// The file that exists while the daemon is ready (--ready-file).
class ReadyFile {
 public:
  explicit ReadyFile(std::string path) : path_(std::move(path)) {}
  ~ReadyFile() { remove(); }

  // Written under another name and renamed, so that a waiting script never sees half of it.
  bool write(const std::string& text) const {
    if (path_.empty()) return true;
    const std::string draft = path_ + ".new";
    std::ofstream(draft) << text << '\n';
    std::error_code error;
    std::filesystem::rename(draft, path_, error);
    return !error;
  }
  void remove() const {
    std::error_code ignored;
    if (!path_.empty()) std::filesystem::remove(path_, ignored);
  }

 private:
  const std::string path_;
};

// After a burst the allocator keeps what was freed. It goes back to the system when it is worth the pause.
void give_memory_back() {
  if (::mallinfo2().fordblks >= kWorthTrimming) ::malloc_trim(0);
}

void warn_of_exposed(const Credentials& credentials, const Log& log) {
  for (const std::string& exposed : credentials.exposed())
    log.warn("credentials exposed", {{"file", exposed}, {"advice", kExposedAdvice}});
}

// Takes over the credentials that have changed, and ends the sessions of those who may no longer speak.
void read_credentials_again(Credentials& credentials, StreamRegistry& streams, const Log& log) {
  const auto changes = credentials.reload(steady_clock::now());
  if (!changes.empty()) warn_of_exposed(credentials, log);
  for (const Credentials::Change& change : changes) {
    if (change.trouble)
      log.error(
          "credentials refused",
          {{"what", change.what}, {"reason", to_string(*change.trouble)}, {"advice", "the former ones stay in use"}});
    else
      log.info("credentials taken over", {{"what", change.what}});
  }
  const size_t ended = streams.end_unless(
      [&](const std::string& client) { return credentials.access().still_controls(client); },
      {grpc::StatusCode::UNAUTHENTICATED, "this caller may no longer have a session"});
  if (ended > 0)
    log.info("sessions ended",
             {{"sessions", std::to_string(ended)}, {"reason", "their callers are no longer in the access file"}});
}

// A running daemon does not end because there is no memory to read a file again. It is tried again later.
void without_ending(const Log& log, const std::function<void()>& work) try { work(); } catch (const std::bad_alloc&) {
  log.error("not read again", {{"reason", "out of memory"}});
}

timespec timespec_of(std::chrono::nanoseconds time) {
  const auto whole = std::chrono::floor<std::chrono::seconds>(time);
  return {whole.count(), (time - whole).count()};
}

// Returns when the daemon is to stop. SIGHUP calls `read_again`; the others do nothing. `tidy_up` is called after the
// pause that one of the two last asked for, however many signals come in between.
void wait_for_stop_signal(const Log& log, const std::function<milliseconds()>& tidy_up,
                          const std::function<milliseconds()>& read_again) {
  const sigset_t signals = awaited_signals();
  steady_clock::time_point due = steady_clock::now() + kTidyPeriod;
  for (;;) {
    const auto left = due - steady_clock::now();
    if (left <= left.zero()) {
      due = steady_clock::now() + tidy_up();
      continue;
    }
    const timespec wait = timespec_of(left);
    const int signal = sigtimedwait(&signals, nullptr, &wait);
    if (signal < 0) continue;
    if (stops(signal)) return log.info("stopping", {{"signal", signal_name(signal)}});
    if (use_of(signal) == SignalUse::kReadsAgain)
      due = steady_clock::now() + read_again();
    else
      log.info("signal ignored", {{"signal", signal_name(signal)}});
  }
}

// What a running daemon can take over from its configuration: the level of the log.
void read_configuration_again(const Log& log, const std::function<Command()>& parse) {
  const Command command = parse();
  if (const auto* serve = std::get_if<Serve>(&command)) {
    log.set_level(serve->flags.log_level);
    return log.info("configuration read again", {{"taken_over", "log-level"}});
  }
  log.error("configuration not read again", {{"reason", "it is not valid; the lines before say why"}});
}

// Waits for kDrainPoll. True: another stop signal came, which ends the wait for the sessions.
bool signalled_again() {
  const sigset_t signals = awaited_signals();
  const timespec wait = timespec_of(kDrainPoll);
  return hurries(sigtimedwait(&signals, nullptr, &wait));
}

WorkLimit::Rules load_rules(const Flags& flags) {
  return {.most_ns = std::llround(flags.max_load_s * 1e9),
          .refusal = "takes more processor time to load than is allowed (--max-load-s)"};
}

// How often the watchdog looks.
constexpr Watchdog::Seconds kWatchPeriod{1.0};

std::vector<Watchdog::Watched> watched_threads(const Listener& listener, const Timers& timers,
                                               const Scheduler& scheduler) {
  return {{"event loop", [&] { return listener.loops_silent(); }},
          {"timers", [&] { return timers.late(); }},
          {"gate", [&] { return listener.gate_silent(); }},
          {"step", [&] { return std::chrono::nanoseconds(scheduler.longest_running_ns()); }}};
}

// After each look of the watchdog: the health service, the log and systemd learn what it saw.
void tell_health(DaemonState& state, Listener& listener, const std::vector<std::string>& hanging, const Log& log) {
  if (hanging.empty()) notify_alive();
  if (!state.set_hanging(hanging)) return;
  listener.set_alive(hanging.empty());
  listener.set_serving(state.ready());
  if (hanging.empty())
    log.info("threads answer again");
  else
    log.error("threads hang", {{"threads", joined(hanging, ", ")}});
}

// The address of a daemon with these flags, for a client on the same host. Through the unix socket, nothing has to be
// encrypted.
std::string local_address(const Flags& flags) {
  if (!flags.listen_unix.empty()) return "unix:" + flags.listen_unix;
  const size_t colon = flags.listen.rfind(':');
  const std::string host = flags.listen.substr(0, colon), port = flags.listen.substr(colon);
  if (host == "0.0.0.0") return "127.0.0.1" + port;
  if (host == "[::]") return "[::1]" + port;
  return flags.listen;
}

// A daemon that wants certificates of its clients is shown its own: the prober has no other.
HealthAddress health_address(const CheckHealth& check) {
  const Flags& flags = check.flags;
  HealthAddress where;
  where.address = check.address.empty() ? local_address(flags) : check.address;
  where.tls = (check.tls || !flags.tls_cert.empty()) && !where.address.starts_with("unix:");
  if (where.tls && !flags.tls_client_ca.empty()) where.certificate = flags.tls_cert, where.key = flags.tls_key;
  return where;
}

void drain(DaemonState& state, Listener& listener, CameraControlService& service, StreamRegistry& streams,
           double drain_s, const Log& log) {
  state.enter(DaemonState::Phase::kStopping);
  notify_stopping();
  listener.set_serving(false);
  service.end_uploads();
  streams.drain("the server is stopping");
  const auto deadline = steady_clock::now() + std::chrono::duration<double>(drain_s);
  while (streams.size() > 0 && steady_clock::now() < deadline && !signalled_again()) {
  }
  if (streams.size() > 0) log.warn("sessions were still open", {{"sessions", std::to_string(streams.size())}});
  streams.end_all({grpc::StatusCode::UNAVAILABLE, "the server stopped"});
}

// With the port that was taken, should the flag ask for a free one.
std::string metrics_address(const Flags& flags, const HttpPort& port) {
  return flags.metrics_listen.substr(0, flags.metrics_listen.rfind(':') + 1) + std::to_string(port.port());
}

int failed_to_start(const Log& log, const Error& error, const std::string& advice) {
  log.error("cannot start", {{"reason", to_string(error)}, {"advice", advice}});
  return EXIT_FAILURE;
}

// The log has a thread of its own, which gets a moment for the last line.
void end_by_force() {
  std::this_thread::sleep_for(milliseconds(200));
  std::_Exit(EXIT_FAILURE);
}

int serve(const Flags& flags, const Log& log, const std::function<Command()>& parse_again) {
  std::optional<LastResort> last_resort;  // outlives what may hang at the end
  const auto prepared = prepare(flags);
  if (!prepared) return failed_to_start(log, prepared.error().error, prepared.error().advice);
  last_resort.emplace(end_by_force);
  Credentials& credentials = *prepared->credentials;
  warn_of_exposed(credentials, log);
  if (prepared->faulty) log.warn("faults are injected", {{"flag", "--inject-fault"}});
  SamplerDevice& sampler = prepared->sampler();
  log.info("sampler",
           {{"kind", sampler.kind()}, {"renderer", sampler.renderer()}, {"reason", prepared->chosen.reason}});
  const auto* const egl = dynamic_cast<const EglSamplerDevice*>(prepared->chosen.device.get());
  const auto context_losses = [egl] { return egl ? egl->context_rebuilds() : uint64_t{0}; };

  std::shared_ptr<Recording> recording;
  if (!flags.record_dir.empty()) recording = std::make_shared<Recording>(flags, log);
  const RecordingRules recorded{.writer = recording ? &recording->writer() : nullptr,
                                .all = flags.record_all,
                                .attach_scenes = flags.record_scenes,
                                .wall_ns = wall_ns};
  const SessionLimits session_limits{.session_bytes = flags.session_memory_mib << 20,
                                     .max_step_cost_ms = flags.max_step_cost_ms};
  InstanceMemory instance_memory(flags.sessions_memory_mib << 20,
                                 share_of_one(flags.client_memory_mib << 20, flags.sessions_memory_mib << 20));
  GltfLimits gltf = GltfLimits::within(flags.geometry_memory_mib << 20);
  gltf.instances_flag = "--session-memory-mib";
  gltf.memory_flag = "--geometry-memory-mib";
  gltf.max_instances = std::min(gltf.max_instances, session_limits.session_bytes / kBytesOfInstance);
  GeometryStore geometry(flags.geometry_memory_mib << 20);
  ExtentCache extents;
  SceneLibrary scenes(flags.scene_dir, gltf, geometry, recording != nullptr, flags.kept_uploads_mib << 20,
                      share_of_one(flags.client_scenes_memory_mib << 20, flags.geometry_memory_mib << 20));
  StreamRegistry streams(flags.max_sessions, share_of_one(flags.max_sessions_per_client, flags.max_sessions));
  Scheduler scheduler(flags.threads > 0 ? flags.threads : static_cast<unsigned>(cpu_budget()), sampler, monotonic_ns);
  WorkerPool loaders(kLoaderThreads);  // destroyed before the scheduler, which its last tasks may still use
  WorkerPool uploaders(kUploaderThreads, kUploaderNiceness);
  const BudgetRules budget = budget_rules(flags);
  FairShares shares(scheduler.threads() * budget.largest_share);
  StepStats stats;
  SessionTable sessions;
  const ServiceParts parts{scenes,           geometry,  extents,        sampler,          scheduler,
                           loaders,          uploaders, streams,        shares,           stats,
                           sessions,         log,       monotonic_ns,   start_name(),     prepared->chosen.reason,
                           budget,           recorded,  session_limits, &instance_memory, &credentials,
                           load_rules(flags)};
  if (const Status well = compute_first_step(parts); !well)
    return failed_to_start(log, well.error(), "no step can be computed on this device; try another --sampler");
  DaemonState state;
  CameraControlService service(parts, service_limits(flags));
  service.tell_ready_by([&state] { return state.ready(); });
  const auto listener = Listener::start(listen_options(flags, scheduler.threads(), credentials, log), service);
  if (!listener) return failed_to_start(log, listener.error(), "choose another address, or stop what uses it");

  std::optional<Watchdog> watchdog(std::in_place, watched_threads(**listener, service.timers(), scheduler),
                                   Watchdog::Seconds(flags.stall_s), kWatchPeriod,
                                   [&](const auto& hanging) { tell_health(state, **listener, hanging, log); });
  std::unique_ptr<HttpPort> operators;
  if (flags.metrics_listen != "none") {
    auto port = HttpPort::start(
        flags.metrics_listen, "--metrics-listen",
        operator_pages({parts, state, [&] { return (*listener)->connections(); }, context_losses}));
    if (!port) return failed_to_start(log, port.error(), "choose another address, or stop what uses it");
    operators = std::move(*port);
  }
  state.enter(DaemonState::Phase::kServing);
  notify_ready();

  const ReadyFile ready(flags.ready_file);
  if (!ready.write(joined((*listener)->addresses(), "\n"))) log.error("cannot write", {{"file", flags.ready_file}});
  log.info("ready", {{"version", kVersion},
                     {"listen", joined((*listener)->addresses(), " ")},
                     {"tls", credentials.tls() ? "yes" : "no"},
                     {"sampler", sampler.kind()},
                     {"threads", std::to_string(scheduler.threads())},
                     {"metrics", operators ? metrics_address(flags, *operators) : "none"},
                     {"recordings", recording ? flags.record_dir : "none"}});
  const auto look_at_credentials = [&]() -> milliseconds {
    without_ending(log, [&] { read_credentials_again(credentials, streams, log); });
    return credentials.settling() ? kSettlePoll : milliseconds(kTidyPeriod);
  };
  uint64_t losses_told = 0;
  const auto tidy_up = [&] {
    sampler.forget_unused();
    if (!credentials.settling()) give_memory_back();  // otherwise the pause was short
    if (const uint64_t losses = context_losses(); losses > std::exchange(losses_told, losses))
      log.warn("graphics context lost and built again", {{"since_the_start", std::to_string(losses)}});
    return look_at_credentials();
  };
  wait_for_stop_signal(log, tidy_up, [&] {
    without_ending(log, [&] { read_configuration_again(log, parse_again); });
    return look_at_credentials();
  });
  const auto rescue = [&log, recording] {
    log.error("ending by force", {{"reason", "a thread of the daemon does not end"}});
    if (recording) recording->complete();
  };
  last_resort->arm(
      std::chrono::duration_cast<LastResort::Duration>(std::chrono::duration<double>(flags.drain_s)) + kLongestEnd,
      rescue);
  ready.remove();
  drain(state, **listener, service, streams, flags.drain_s, log);
  last_resort->arm(kLongestEnd, rescue);
  operators.reset();
  watchdog.reset();
  (*listener)->stop(kStopGrace);
  // Before the last resort goes, since a disk may hang.
  if (recording) recording->complete();
  log.info("stopped", {{"steps", std::to_string(stats.steps)},
                       {"degraded", std::to_string(stats.degraded)},
                       {"late", std::to_string(stats.late)},
                       {"queue_p50_us", std::to_string(std::lround(stats.queue.quantile_us(0.5)))},
                       {"queue_p99_us", std::to_string(std::lround(stats.queue.quantile_us(0.99)))}});
  return EXIT_SUCCESS;
}

// Whatever is still thrown here happened at the start or at the end; sessions handle their own.
int serve_or_explain(const Flags& flags, const Log& log, const std::function<Command()>& parse_again) try {
  return serve(flags, log, parse_again);
} catch (const std::bad_alloc&) {
  log.error("cannot go on",
            {{"reason", "out of memory"}, {"advice", "raise the limit of the process or the container"}});
  return EXIT_FAILURE;
} catch (const std::system_error& trouble) {
  log.error("cannot go on", {{"reason", trouble.what()}, {"advice", "raise the limits of threads and memory"}});
  return EXIT_FAILURE;
}

// Returns only when it fails.
int become_demo(const std::vector<std::string>& arguments) {
  std::error_code none;
  const std::string program = std::filesystem::read_symlink("/proc/self/exe", none).replace_filename("sightline");
  std::vector<std::string> words{"sightline", "demo"};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  ::execv(program.c_str(), argv.data());
  std::fprintf(stderr, "sightlined demo: cannot run %s: %s\n", program.c_str(), std::strerror(errno));
  return EXIT_FAILURE;
}

}  // namespace
}  // namespace sightline

int main(int argc, char** argv) {
  using namespace sightline;
  const Command command = parse_command_line(argc, argv);
  if (const auto* exit = std::get_if<Exit>(&command)) return exit->code;
  if (const auto* demo = std::get_if<BecomeDemo>(&command)) return become_demo(demo->arguments);
  prepare_process();
  if (const auto* report = std::get_if<ReportDevices>(&command))
    return report_devices(report->flags.sampler, egl_options(report->flags), report->json);
  if (const auto* check = std::get_if<CheckHealth>(&command))
    return check_health(health_address(*check), check->alive ? "liveness" : "readiness", std::cout, std::cerr);
  if (const auto* check = std::get_if<CheckConfig>(&command)) return check_configuration(check->flags);
  const Flags& flags = std::get<Serve>(command).flags;
  say_last_words(flags.log_format, flags.log_level);
  be_told_before_cpu_limit(flags.drain_s + 1.0);
  const Log log(flags.log_format, flags.log_level);
  return serve_or_explain(flags, log, [=] { return parse_command_line(argc, argv); });
}
