// Runs a load from its start to its figures: scene, daemon, sessions, windows, result.
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <iterator>
#include <limits>
#include <sstream>
#include <thread>

#include "client/base/process.h"
#include "client/base/progress_bar.h"
#include "client/base/wire_presets.h"
#include "client/bench/command.h"
#include "client/bench/generator.h"
#include "client/cpp/session_stream.h"
#include "client/cpp/sightline_client.h"
#include "scenes/catalog.h"
#include "server/scene/confined_folder.h"

namespace sightline {
namespace {

using namespace std::chrono_literals;

constexpr size_t kDaemonSessions = 64;  // that the started daemon allows, unless the load or a flag asks for more
constexpr auto kStartTimeout = 60s;
constexpr auto kOpenTimeout = 60s, kConnectTimeout = 5s;
constexpr auto kSettleTimeout = 5s;  // for the answers to the last ticks
constexpr auto kPoll = 5ms;
constexpr auto kLongestWait = 100ms;  // between two updates of the progress bar
constexpr int kFirstTicks = 30;       // sent by the first session alone; they load the scene into the sampler

int64_t to_ns(double seconds) {
  return static_cast<int64_t>(seconds * 1e9);
}

Result<std::vector<std::byte>> scene_bytes(const BenchOptions& options) {
  if (const scenes::CatalogEntry* entry = scenes::find_scene(options.scene))
    return entry->make({.seed = options.world.seed});
  std::error_code trouble;
  if (std::filesystem::is_regular_file(options.scene, trouble)) return read_whole_file(options.scene, SIZE_MAX);
  return fail(ErrorCode::kNotFound, "scene", "\"" + options.scene + "\" is neither a generated scene nor a file");
}

Result<v1::OpenSession> settings_of(const BenchOptions& options) {
  const auto preset = preset_named(options.preset);
  if (!preset) return tl::unexpected(preset.error());
  const auto given = settings_from_json(options.settings.empty() ? "{}" : options.settings);
  if (!given) return invalid("settings", given.error().message);
  v1::OpenSession open;
  open.mutable_settings()->set_preset(*preset);
  open.MergeFrom(*given);
  tuning::v1alpha1::Tuning& tuning = *open.mutable_tuning();
  if (options.resolution) tuning.mutable_sample()->set_resolution(*options.resolution);
  if (options.points) tuning.mutable_sample()->set_points(*options.points);
  if (options.candidates) tuning.mutable_aggregate()->set_candidates(*options.candidates);
  return open;
}

BenchSchedule schedule_of(const BenchOptions& options) {
  return BenchSchedule({.sessions = options.world.sessions,
                        .rate_hz = options.world.rate_hz,
                        .window_s = options.window_s,
                        .warm_up_s = options.warm_up_s,
                        .echo = !options.echo.empty()});
}

// CPU times of this process and of the daemon up to one moment.
struct CpuTimes {
  int64_t at_ns = 0, own_ns = 0, daemon_ns = 0;
};

class Bench {
 public:
  Bench(const BenchOptions& options, std::ostream& err)
      : options_(options), schedule_(schedule_of(options)), bar_(err, options.progress) {}
  // Closes the streams before the daemon at their other end.
  ~Bench() { close_streams(); }

  Result<BenchJson> run() {
    for (const auto part :
         {&Bench::read_scene, &Bench::find_daemon, &Bench::open_first, &Bench::open_rest, &Bench::measure})
      if (const Status done = (this->*part)(); !done) return tl::unexpected(done.error());
    return finish();
  }

 private:
  using Streams = std::vector<std::unique_ptr<BenchStream>>;

  Status read_scene() {
    bar_.show("scene", 0, 1);
    auto bytes = scene_bytes(options_);
    if (!bytes) return tl::unexpected(bytes.error());
    scene_ = std::move(*bytes);
    auto world = BenchWorld::make(scene_, options_.world);
    if (!world) return tl::unexpected(world.error());
    world_.emplace(std::move(*world));
    auto settings = settings_of(options_);
    if (!settings) return tl::unexpected(settings.error());
    settings_ = std::move(*settings);
    return {};
  }

  Status find_daemon() {
    address_ = options_.address;
    daemon_pid_ = options_.daemon_pid;
    if (options_.address.empty())
      if (const Status started = start_daemon(); !started) return started;
    auto credentials = read_credentials(options_.connection);
    if (!credentials) return tl::unexpected(credentials.error());
    credentials_ = std::move(*credentials);
    auto client = Client::connect(address_, 5s, {}, credentials_);
    if (!client) return tl::unexpected(client.error());
    client_.emplace(std::move(*client));
    start_bytes_ = resident_bytes();
    bar_.show("upload", 0, 1);
    auto uploaded = client_->upload_scene(scene_, 2min);
    if (!uploaded) return tl::unexpected(uploaded.error());
    scene_hash_ = uploaded->hash();
    return {};
  }

  Status start_daemon() {
    bar_.show("daemon", 0, 1);
    if (scratch_.path().empty()) return fail(ErrorCode::kUnavailable, "", "no temporary folder can be made");
    const std::filesystem::path folder = scratch_.path(), own = options_.program;
    const std::string program = options_.daemon.empty() ? (own.parent_path() / "sightlined").string() : options_.daemon;
    const std::string ready = folder / "ready";
    std::vector<std::string> flags{"--ready-file", ready, "--log-level", "warning", "--listen"};
    if (options_.tcp)
      flags.push_back("127.0.0.1:0");
    else
      flags.insert(flags.end(), {"none", "--listen-unix", folder / "daemon.sock"});
    // All sessions are one client's. A flag that is given keeps its value.
    std::istringstream words(options_.daemon_flags);
    const std::vector<std::string> given_flags{std::istream_iterator<std::string>(words), {}};
    const auto unless_given = [&](const std::string& flag) {
      const auto names_it = [&](const std::string& word) { return word == flag || word.starts_with(flag + "="); };
      if (std::ranges::none_of(given_flags, names_it))
        flags.insert(flags.end(), {flag, std::to_string(std::max(options_.world.sessions, kDaemonSessions))});
    };
    unless_given("--max-sessions");
    unless_given("--max-sessions-per-client");
    flags.insert(flags.end(), given_flags.begin(), given_flags.end());
    auto process = ChildProcess::start(program, flags, folder / "daemon.log");
    if (!process) return tl::unexpected(process.error());
    daemon_ = std::move(*process);
    auto address = daemon_->wait_for_line(ready, kStartTimeout);
    if (!address) return tl::unexpected(address.error());
    address_ = *address;
    daemon_pid_ = daemon_->pid();
    return {};
  }

  // ---- sessions

  // Adds a stream. Every so many streams share a connection of their own, as the sessions of one game server would.
  Status add_stream(const std::string& address, const ClientCredentials& credentials, BenchProtocol protocol,
                    Streams& streams, std::shared_ptr<grpc::Channel>& channel) {
    if (streams.size() % options_.sessions_per_channel == 0) {
      grpc::ChannelArguments arguments;
      arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
      arguments.SetMaxReceiveMessageSize(-1);
      // They were good for the client's own connection.
      channel = grpc::CreateCustomChannel(address, *channel_credentials(credentials, address), arguments);
      // gRPC 1.51 may fail its first try for no reason (its pull request 35064); this waits for the next one.
      if (!channel->WaitForConnected(std::chrono::system_clock::now() + kConnectTimeout))
        return fail(ErrorCode::kUnavailable, "address", "no server answers at " + address);
    }
    const int64_t late_ns = to_ns(schedule_.interval_s());
    streams.push_back(std::make_unique<BenchStream>(loop_, channel, std::move(protocol), late_ns, credentials.token));
    return {};
  }

  Status open_sessions(size_t first, size_t until) {
    for (size_t i = first; i < until; ++i) {
      v1::OpenSession open = world_->open(i, scene_hash_);
      open.MergeFrom(settings_);
      const Status added = add_stream(address_, credentials_, control_protocol(*world_, i, std::move(open)), sessions_,
                                      session_channel_);
      if (!added) return added;
    }
    for (size_t i = first; i < until; ++i) {
      bar_.show("open", i, options_.world.sessions);
      const auto opened = sessions_[i]->wait_opened(kOpenTimeout);
      if (!opened) return refused(i, opened.error());
      opened_ = *opened;
    }
    return {};
  }

  Status refused(size_t session, const Error& error) const {
    std::string message = "session " + std::to_string(session + 1) + " of " + std::to_string(options_.world.sessions) +
                          " was refused: " + error.message;
    return fail(error.code, error.field.empty() ? "sessions" : error.field, std::move(message));
  }

  Status open_first() {
    if (const Status opened = open_sessions(0, 1); !opened) return opened;
    for (int i = 0; i < kFirstTicks; ++i) {
      sessions_.front()->send_tick(BenchStream::monotonic_ns(), -1);
      std::this_thread::sleep_for(std::chrono::duration<double>(schedule_.interval_s()));
    }
    if (const Status settled = wait_settled(kOpenTimeout, [] { return true; }); !settled) return settled;
    scene_bytes_ = resident_bytes();
    return {};
  }

  Status open_rest() {
    if (const Status opened = open_sessions(1, options_.world.sessions); !opened) return opened;
    std::shared_ptr<grpc::Channel> channel;
    for (size_t i = 0; has_echo() && i < sessions_.size(); ++i) {
      const Status added = add_stream(
          options_.echo, {}, echo_protocol([this, i] { return sessions_[i]->last_sizes(); }), echoes_, channel);
      if (!added) return added;
    }
    return {};
  }

  bool has_echo() const { return !options_.echo.empty(); }

  // ---- windows

  Status measure() {
    generator_.emplace(schedule_, pointers(sessions_), pointers(echoes_));
    const BenchPeer last = has_echo() ? BenchPeer::kEcho : BenchPeer::kDaemon;
    const int64_t begin_ns = schedule_.begin_ns(BenchPeer::kDaemon, 0);
    const int64_t turn_ns = schedule_.begin_ns(BenchPeer::kDaemon, 1) - begin_ns;
    for (int window = 0;; ++window) {
      const int64_t end_ns = schedule_.end_ns(last, window);
      if (const Status measured = measure_window(window, end_ns); !measured) return measured;
      stable_ = are_stable(round_trips_);
      if (stable_ && !options_.all_windows) break;
      if (end_ns - begin_ns + turn_ns > to_ns(options_.max_duration_s)) break;
    }
    sessions_bytes_ = resident_bytes();
    generator_->stop();
    static_cast<void>(wait_settled(kSettleTimeout, [] { return true; }));  // what stays unanswered counts as lost
    return {};
  }

  // Waits for the window, and then until every tick that was due in it is answered, however late: a window is never
  // judged by its fast answers alone.
  Status measure_window(int window, int64_t end_ns) {
    if (const Status waited = wait_until(schedule_.begin_ns(BenchPeer::kDaemon, window)); !waited) return waited;
    const CpuTimes before = cpu_times();
    if (const Status waited = wait_until(schedule_.end_ns(BenchPeer::kDaemon, window)); !waited) return waited;
    const CpuTimes after = cpu_times();
    if (const Status waited = wait_until(end_ns); !waited) return waited;
    const auto all_sent = [&] { return generator_->sent_until_ns() >= end_ns; };
    const auto timeout = std::chrono::nanoseconds(to_ns(options_.max_duration_s));
    if (const Status settled = wait_settled(timeout, all_sent, generator_->start_ns() + end_ns); !settled)
      return settled;
    collect(window, before, after);
    return {};
  }

  int64_t since_start_ns() const { return BenchStream::monotonic_ns() - generator_->start_ns(); }

  Status wait_until(int64_t ns) {
    while (true) {
      const std::chrono::nanoseconds left(ns - since_start_ns());
      if (left <= 0ns) return {};
      show_progress();
      if (const Status alive = check_alive(); !alive) return alive;
      std::this_thread::sleep_for(std::min<std::chrono::nanoseconds>(left, kLongestWait));
    }
  }

  // Waits until `ready` is true and every tick that was due before `due_ns`, on the clock of the streams, is settled.
  template <typename Ready>
  Status wait_settled(std::chrono::nanoseconds timeout, Ready ready,
                      int64_t due_ns = std::numeric_limits<int64_t>::max()) {
    const auto deadline = std::chrono::steady_clock::now() + timeout;
    while (!ready() || settled_until_ns() < due_ns) {
      if (std::chrono::steady_clock::now() > deadline)
        return fail(ErrorCode::kUnavailable, "deadline", "the server leaves ticks unanswered");
      if (const Status alive = check_alive(); !alive) return alive;
      std::this_thread::sleep_for(kPoll);
    }
    return {};
  }

  int64_t settled_until_ns() const {
    int64_t oldest_ns = std::numeric_limits<int64_t>::max();
    for (const Streams* streams : {&sessions_, &echoes_})
      for (const auto& stream : *streams) oldest_ns = std::min(oldest_ns, stream->oldest_pending_ns());
    return oldest_ns;
  }

  Status check_alive() const {
    for (const Streams* streams : {&sessions_, &echoes_})
      for (size_t i = 0; i < streams->size(); ++i)
        if (const auto end = (*streams)[i]->end())
          return fail(end->code, end->field,
                      "session " + std::to_string(i + 1) + " ended under the load: " + end->message);
    return {};
  }

  void collect(int window, const CpuTimes& before, const CpuTimes& after) {
    MeasuredWindow& measured = windows_.emplace_back();
    for (const auto& session : sessions_) {
      const BenchWindow own = session->take_window(window);
      measured.replies_by_session.push_back(own.replies);
      measured.daemon.add(own);
    }
    round_trips_.push_back(quantiles_of(measured.daemon.of(BenchMetric::kRoundTrip)));
    // Microseconds a tick. The two moments are only near the window's ends, so CPU time is scaled to the window's
    // length.
    const auto a_tick_us = [&](int64_t used_ns) {
      const auto span_ns = static_cast<double>(after.at_ns - before.at_ns);
      const auto ticks = static_cast<double>(std::max<uint64_t>(measured.daemon.ticks(), 1));
      return static_cast<double>(used_ns) / span_ns * options_.window_s * 1e6 / ticks;
    };
    measured.generator_cpu_us = a_tick_us(after.own_ns - before.own_ns);
    if (daemon_pid_ != 0) measured.daemon_cpu_us = a_tick_us(after.daemon_ns - before.daemon_ns);
    if (!has_echo()) return;
    measured.echo.emplace();
    for (const auto& echo : echoes_) measured.echo->add(echo->take_window(window));
  }

  // ---- helpers

  CpuTimes cpu_times() const {
    CpuTimes times{.at_ns = BenchStream::monotonic_ns()};
    if (const auto own = usage_of(getpid())) times.own_ns = own->cpu_ns;
    if (daemon_pid_ == 0) return times;
    if (const auto usage = usage_of(daemon_pid_)) times.daemon_ns = usage->cpu_ns;
    return times;
  }

  size_t resident_bytes() const {
    const auto usage = usage_of(daemon_pid_);
    return daemon_pid_ != 0 && usage ? usage->resident_bytes : 0;
  }

  static std::vector<BenchStream*> pointers(const Streams& streams) {
    std::vector<BenchStream*> all;
    for (const auto& stream : streams) all.push_back(stream.get());
    return all;
  }

  void show_progress() {
    const int64_t total_ns = schedule_.begin_ns(BenchPeer::kDaemon, 0) + to_ns(options_.max_duration_s);
    bar_.show("windows: " + std::to_string(windows_.size()),
              static_cast<size_t>(std::min(since_start_ns(), total_ns) / 1'000'000),
              static_cast<size_t>(total_ns / 1'000'000));
  }

  void close_streams() {
    generator_.reset();
    const auto deadline = std::chrono::steady_clock::now() + kSettleTimeout;  // for all of them
    for (const auto& session : sessions_)
      session->close(std::max<std::chrono::nanoseconds>(deadline - std::chrono::steady_clock::now(), 0ns));
    echoes_.clear();
  }

  // ---- the result

  Result<BenchJson> finish() {
    bar_.clear();
    close_streams();
    const size_t seen = windows_.size(), reported = stable_ && !options_.all_windows ? kStableWindows : seen;
    BenchJson result = summarize(std::span(windows_).last(reported), load_json());
    result["stable"] = stable_;
    result["windows"]["seen"] = seen;
    result["daemon_memory"] = daemon_pid_ == 0 ? BenchJson(nullptr) : memory_json();
    TickCounts ticks;
    std::string trouble;
    for (const auto& session : sessions_) {
      ticks += session->counts();
      if (trouble.empty()) trouble = session->trouble();
    }
    result["ticks"] = {{"sent", ticks.sent},
                       {"answered", ticks.answered},
                       {"merged", ticks.merged},
                       {"rejected", ticks.rejected},
                       {"lost", ticks.lost}};
    result["trouble"] = trouble;
    return result;
  }

  BenchJson load_json() const {
    const BenchWorldOptions& world = options_.world;
    return {{"address", address_},
            {"sampler", opened_.sampler},
            {"sessions", world.sessions},
            {"rate_hz", world.rate_hz},
            {"window_s", options_.window_s},
            {"targets", world.targets},
            {"moving", world.moving},
            {"instances", opened_.instances},
            {"triangles", opened_.triangles},
            {"channels", (world.sessions - 1) / options_.sessions_per_channel + 1}};
  }

  BenchJson memory_json() const {
    const double further_bytes = static_cast<double>(sessions_bytes_) - static_cast<double>(scene_bytes_);
    const auto further = static_cast<double>(options_.world.sessions - 1);
    return {{"start_bytes", start_bytes_},
            {"scene_bytes", scene_bytes_},
            {"sessions_bytes", sessions_bytes_},
            {"per_session_bytes", further > 0 ? BenchJson(further_bytes / further) : BenchJson(nullptr)}};
  }

  const BenchOptions& options_;
  const BenchSchedule schedule_;
  ProgressBar bar_;
  ScratchFolder scratch_;
  std::vector<std::byte> scene_;
  std::optional<BenchWorld> world_;
  v1::OpenSession settings_;  // nothing but settings and tuning
  std::unique_ptr<ChildProcess> daemon_;
  pid_t daemon_pid_ = 0;
  ClientCredentials credentials_;
  std::string address_;  // of the daemon
  std::optional<Client> client_;
  std::string scene_hash_;
  BenchOpened opened_;
  std::shared_ptr<grpc::Channel> session_channel_;
  EventLoop loop_{std::make_unique<grpc::CompletionQueue>()};
  Streams sessions_, echoes_;  // an echo sends messages as long as its session's
  std::optional<BenchGenerator> generator_;
  std::vector<MeasuredWindow> windows_;
  std::vector<Quantiles> round_trips_;  // one for each window
  bool stable_ = false;
  // Resident memory of the daemon: before the scene; with the scene and one session; with all sessions, at the end of
  // the load.
  size_t start_bytes_ = 0, scene_bytes_ = 0, sessions_bytes_ = 0;
};

}  // namespace

Result<BenchJson> run_bench(const BenchOptions& options, std::ostream& err) {
  return Bench(options, err).run();
}

}  // namespace sightline
