// A load from its start to its figures: scene, daemon, sessions, echo, windows, result.
#include <google/protobuf/util/json_util.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <limits>
#include <sstream>
#include <thread>

#include "client/bench/command.h"
#include "client/bench/dialect.h"
#include "client/bench/echo.h"
#include "client/bench/generator.h"
#include "client/bench/process.h"
#include "client/bench/schedule.h"
#include "client/base/file_bytes.h"
#include "client/base/progress_bar.h"
#include "client/cpp/sightline_client.h"
#include "client/base/wire_presets.h"
#include "scenes/catalog.h"

namespace sightline {
namespace {

using namespace std::chrono_literals;

constexpr size_t kDaemonSessions = 64;  // its own limit, unless told otherwise
constexpr auto kStartTimeout = 60s;
constexpr auto kOpenTimeout = 60s;
constexpr auto kSettleTimeout = 5s;  // for what is still unanswered when no more is sent
constexpr auto kPoll = 5ms;
constexpr auto kLongestWait = 100ms;  // between two looks at the bar and the streams
constexpr auto kAfterwards = 300ms;   // until the daemon has let go of closed sessions
constexpr int kFirstTicks = 30;       // of the first session alone: they bring the scene to the sampler

int64_t to_ns(double seconds) {
  return static_cast<int64_t>(seconds * 1e9);
}

Result<std::vector<std::byte>> scene_bytes(const BenchOptions& options) {
  if (const scenes::CatalogEntry* entry = scenes::find_scene(options.scene))
    return entry->make({.seed = options.seed});
  std::error_code trouble;
  if (std::filesystem::is_regular_file(options.scene, trouble)) return read_file(options.scene);
  return fail(ErrorCode::kNotFound, "scene",
              "\"" + options.scene + "\" is neither a generated scene nor a file");
}

Result<v1::Settings> settings_of(const BenchOptions& options) {
  const auto preset = preset_named(options.preset);
  if (!preset) return tl::unexpected(preset.error());
  v1::Settings given;
  if (!options.settings.empty()) {
    const auto parsed = google::protobuf::util::JsonStringToMessage(options.settings, &given);
    if (!parsed.ok()) return invalid("settings", std::string(parsed.message()));
  }
  v1::Settings settings;
  settings.set_preset(*preset);
  settings.MergeFrom(given);
  if (options.resolution) settings.mutable_sample()->set_resolution(*options.resolution);
  if (options.points) settings.mutable_sample()->set_points(*options.points);
  if (options.candidates) settings.mutable_aggregate()->set_candidates(*options.candidates);
  return settings;
}

BenchSchedule schedule_of(const BenchOptions& options) {
  return BenchSchedule({.sessions = options.sessions,
                        .rate_hz = options.rate_hz,
                        .window_s = options.window_s,
                        .warm_up_s = options.warm_up_s,
                        .echo = options.echo});
}

BenchWorldOptions world_of(const BenchOptions& options) {
  return {.targets = options.targets,
          .moving = options.moving,
          .instances = std::max(options.moving, options.instances),
          .sessions = options.sessions,
          .rate_hz = options.rate_hz,
          .seed = options.seed};
}

std::vector<std::string> words_of(const std::string& text) {
  std::istringstream in(text);
  std::vector<std::string> words;
  for (std::string word; in >> word;) words.push_back(word);
  return words;
}

// What this process and one beside it had used at one moment.
struct CpuTimes {
  int64_t at_ns = 0, own_ns = 0, peer_ns = 0;
};

struct CpuSpan {
  CpuTimes before, after;

  double own_us(double window_s, uint64_t ticks) const {
    return a_tick_us(after.own_ns - before.own_ns, window_s, ticks);
  }
  double peer_us(double window_s, uint64_t ticks) const {
    return a_tick_us(after.peer_ns - before.peer_ns, window_s, ticks);
  }

 private:
  // The moments are only about the window's ends: what was used between them counts by the time.
  double a_tick_us(int64_t used_ns, double window_s, uint64_t ticks) const {
    const auto span_ns = static_cast<double>(after.at_ns - before.at_ns);
    if (span_ns <= 0.0 || ticks == 0) return 0.0;
    return static_cast<double>(used_ns) / span_ns * window_s * 1e6 / static_cast<double>(ticks);
  }
};

class Bench {
 public:
  Bench(const BenchOptions& options, std::ostream& err)
      : options_(options), schedule_(schedule_of(options)), bar_(err, options.progress) {}
  // Streams first: they end before the processes that they speak to.
  ~Bench() { close_streams(); }

  Result<BenchResult> run() {
    for (const auto part : {&Bench::read_scene, &Bench::find_daemon, &Bench::open_first, &Bench::open_rest,
                            &Bench::start_echo, &Bench::measure})
      if (const Status done = (this->*part)(); !done) return tl::unexpected(done.error());
    return finish();
  }

 private:
  using Streams = std::vector<std::unique_ptr<BenchStream>>;

  Status read_scene() {
    if (scratch_.path().empty())
      return fail(ErrorCode::kUnavailable, "scratch", "no temporary folder can be made");
    bar_.show("scene", 0, 1);
    auto bytes = scene_bytes(options_);
    if (!bytes) return tl::unexpected(bytes.error());
    scene_ = std::move(*bytes);
    auto world = BenchWorld::make(scene_, world_of(options_));
    if (!world) return tl::unexpected(world.error());
    world_ = std::make_unique<BenchWorld>(std::move(*world));
    auto settings = settings_of(options_);
    if (!settings) return tl::unexpected(settings.error());
    settings_ = std::move(*settings);
    return {};
  }

  Status find_daemon() {
    result_.address = options_.address;
    daemon_pid_ = options_.daemon_pid;
    if (options_.address.empty())
      if (const Status started = start_daemon(); !started) return started;
    auto client = Client::connect(result_.address, 5s);
    if (!client) return tl::unexpected(client.error());
    client_.emplace(std::move(*client));
    memory_.start = resident_bytes();
    bar_.show("upload", 0, 1);
    auto uploaded = client_->upload_scene(scene_, 2min);
    if (!uploaded) return tl::unexpected(uploaded.error());
    scene_hash_ = uploaded->hash();
    return {};
  }

  Status start_daemon() {
    bar_.show("daemon", 0, 1);
    const std::filesystem::path folder = scratch_.path(), own = options_.program;
    const std::string program =
        options_.daemon.empty() ? (own.parent_path() / "sightlined").string() : options_.daemon;
    const std::string ready = folder / "ready";
    std::vector<std::string> flags{"--ready-file", ready, "--log-level", "warning"};
    if (options_.tcp) {
      flags.insert(flags.end(), {"--listen", "127.0.0.1:0"});
    } else {
      flags.insert(flags.end(), {"--listen", "none", "--listen-unix", folder / "daemon.sock"});
    }
    if (options_.sessions > kDaemonSessions &&
        options_.daemon_flags.find("--max-sessions") == std::string::npos)
      flags.insert(flags.end(), {"--max-sessions", std::to_string(options_.sessions)});
    for (const std::string& word : words_of(options_.daemon_flags)) flags.push_back(word);
    auto process = ChildProcess::start(program, flags, folder / "daemon.out", folder / "daemon.err");
    if (!process) return tl::unexpected(process.error());
    daemon_ = std::move(*process);
    auto address = daemon_->wait_for_line(ready, kStartTimeout);
    if (!address) return tl::unexpected(address.error());
    result_.address = *address;
    daemon_pid_ = daemon_->pid();
    return {};
  }

  // A connection of its own for every so many sessions, as several game servers would have.
  std::shared_ptr<grpc::Channel> channel_to(const std::string& address) const {
    grpc::ChannelArguments arguments;
    arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
    arguments.SetMaxReceiveMessageSize(-1);
    return grpc::CreateCustomChannel(address, grpc::InsecureChannelCredentials(), arguments);
  }

  template <typename MakeDialect>
  void add_streams(const std::string& address, size_t until, MakeDialect make_dialect, Streams& streams,
                   std::shared_ptr<grpc::Channel>& channel) {
    const int64_t late_ns = to_ns(schedule_.interval_s());
    while (streams.size() < until) {
      if (streams.size() % options_.sessions_per_channel == 0) channel = channel_to(address);
      streams.push_back(std::make_unique<BenchStream>(*loop_, channel, make_dialect(streams.size()), late_ns));
    }
  }

  Status open_sessions(size_t first, size_t until) {
    const auto dialect = [&](size_t session) {
      v1::OpenSession open = world_->open(session, scene_hash_);
      *open.mutable_settings() = settings_;
      return control_dialect(*world_, session, std::move(open));
    };
    add_streams(result_.address, until, dialect, sessions_, daemon_channel_);
    for (size_t session = first; session < until; ++session) {
      bar_.show("open", session, options_.sessions);
      const auto opened = sessions_[session]->wait_opened(kOpenTimeout);
      if (!opened) return refused(session, opened.error());
      if (session == 0) opened_ = *opened;
    }
    return {};
  }

  Status refused(size_t session, const Error& error) const {
    std::string message = "session " + std::to_string(session + 1) + " of " +
                          std::to_string(options_.sessions) + " was refused: " + error.message;
    return fail(error.code, error.field.empty() ? "sessions" : error.field, std::move(message));
  }

  Status open_first() {
    if (const Status opened = open_sessions(0, 1); !opened) return opened;
    BenchStream& first = *sessions_.front();
    for (int i = 0; i < kFirstTicks; ++i) {
      first.send_tick(BenchStream::monotonic_ns(), -1);
      std::this_thread::sleep_for(std::chrono::duration<double>(schedule_.interval_s()));
    }
    const int64_t deadline_ns = BenchStream::monotonic_ns() + std::chrono::nanoseconds(kOpenTimeout).count();
    while (settled_until_ns(sessions_) < deadline_ns && BenchStream::monotonic_ns() < deadline_ns) {
      if (const Status alive = check_alive(sessions_); !alive) return alive;
      std::this_thread::sleep_for(kPoll);
    }
    memory_.scene = resident_bytes();
    return {};
  }

  Status open_rest() { return open_sessions(1, options_.sessions); }

  Status start_echo() {
    if (!options_.echo) return {};
    const std::filesystem::path folder = scratch_.path();
    const bool socket = result_.address.starts_with("unix:");
    const std::string listen = socket ? "unix:" + (folder / "echo.sock").string() : "127.0.0.1:0";
    const std::string said = folder / "echo.out";
    auto process =
        ChildProcess::start(options_.program, {"echo", "--listen", listen}, said, folder / "echo.err");
    if (!process) return tl::unexpected(process.error());
    echo_ = std::move(*process);
    const auto address = echo_->wait_for_line(said, kStartTimeout);
    if (!address) return tl::unexpected(address.error());
    std::shared_ptr<grpc::Channel> channel;
    add_streams(
        *address, options_.sessions, [&](size_t i) { return echo_dialect(*sessions_[i]); }, echoes_, channel);
    return {};
  }

  // --- windows

  Status measure() {
    generator_.emplace(schedule_, pointers(sessions_), pointers(echoes_), options_.threads);
    const int64_t most_ns = to_ns(options_.max_duration_s);
    for (int window = 0;; ++window) {
      const int64_t last_end_ns = schedule_.end_ns(last_peer(), window);
      if (const Status watched = watch(window); !watched) return watched;
      if (const Status settled = wait_settled(last_end_ns); !settled) return settled;
      collect(window);
      if (is_stable()) break;
      if (last_end_ns - schedule_.begin_ns(BenchPeer::kDaemon, 0) + window_ns() > most_ns) break;
    }
    memory_.sessions = resident_bytes();
    generator_->stop();
    return settle_rest();
  }

  BenchPeer last_peer() const { return options_.echo ? BenchPeer::kEcho : BenchPeer::kDaemon; }
  // From the start of one window of the daemon to that of the next.
  int64_t window_ns() const {
    return schedule_.begin_ns(BenchPeer::kDaemon, 1) - schedule_.begin_ns(BenchPeer::kDaemon, 0);
  }
  int64_t since_start_ns() const { return BenchStream::monotonic_ns() - generator_->start_ns(); }

  // CPU times over the window of each peer.
  Status watch(int window) {
    windows_.emplace_back();
    if (const Status done = watch_peer(BenchPeer::kDaemon, window, daemon_pid_, daemon_cpu_); !done)
      return done;
    if (!options_.echo) return {};
    return watch_peer(BenchPeer::kEcho, window, echo_->pid(), echo_cpu_);
  }

  Status watch_peer(BenchPeer peer, int window, pid_t pid, CpuSpan& cpu) {
    if (const Status waited = wait_until(schedule_.begin_ns(peer, window)); !waited) return waited;
    // Of windows without a gap, where one ends the next has begun.
    cpu.before = window > 0 && schedule_.begin_ns(peer, window) == schedule_.end_ns(peer, window - 1)
                     ? cpu.after
                     : cpu_times(pid);
    if (const Status waited = wait_until(schedule_.end_ns(peer, window)); !waited) return waited;
    cpu.after = cpu_times(pid);
    return {};
  }

  Status wait_until(int64_t ns) {
    while (true) {
      const int64_t left_ns = ns - since_start_ns();
      if (left_ns <= 0) return {};
      show_progress();
      if (const Status alive = check_alive(sessions_); !alive) return alive;
      std::this_thread::sleep_for(
          std::min<std::chrono::nanoseconds>(std::chrono::nanoseconds(left_ns), kLongestWait));
    }
  }

  // Until every tick that was due before has been sent and has its answer, however late that is: a window is never judged by
  // its quick answers alone.
  Status wait_settled(int64_t ns) {
    const int64_t deadline_ns = ns + to_ns(options_.max_duration_s);
    while (generator_->sent_until_ns() < ns ||
           std::min(settled_until_ns(sessions_), settled_until_ns(echoes_)) < generator_->start_ns() + ns) {
      if (since_start_ns() > deadline_ns)
        return fail(ErrorCode::kUnavailable, "deadline", "the server leaves ticks unanswered");
      if (const Status alive = check_alive(sessions_); !alive) return alive;
      if (const Status alive = check_alive(echoes_); !alive) return alive;
      std::this_thread::sleep_for(kPoll);
    }
    return {};
  }

  void collect(int window) {
    MeasuredWindow& measured = windows_.back();
    for (const auto& session : sessions_) {
      const BenchWindow own = session->take_window(window);
      measured.replies_by_session.push_back(own.replies);
      measured.daemon.add(own);
    }
    round_trips_.push_back(quantiles_of(measured.daemon.of(BenchMetric::kRoundTrip)));
    measured.generator_cpu_us = daemon_cpu_.own_us(options_.window_s, measured.daemon.ticks());
    if (daemon_pid_ != 0)
      measured.daemon_cpu_us = daemon_cpu_.peer_us(options_.window_s, measured.daemon.ticks());
    if (!options_.echo) return;
    measured.echo.emplace();
    for (const auto& echo : echoes_) measured.echo->add(echo->take_window(window));
    measured.echo_generator_cpu_us = echo_cpu_.own_us(options_.window_s, measured.echo->ticks());
    measured.echo_cpu_us = echo_cpu_.peer_us(options_.window_s, measured.echo->ticks());
  }

  bool is_stable() { return result_.stable = agree(round_trips_, options_.stable); }

  Status settle_rest() {
    const int64_t deadline_ns =
        BenchStream::monotonic_ns() + std::chrono::nanoseconds(kSettleTimeout).count();
    while (BenchStream::monotonic_ns() < deadline_ns &&
           settled_until_ns(sessions_) != std::numeric_limits<int64_t>::max())
      std::this_thread::sleep_for(kPoll);
    return {};
  }

  // --- small things

  static CpuTimes cpu_times(pid_t peer) {
    CpuTimes times{.at_ns = BenchStream::monotonic_ns()};
    if (const auto own = usage_of(getpid())) times.own_ns = own->cpu_ns;
    if (peer == 0) return times;
    if (const auto usage = usage_of(peer)) times.peer_ns = usage->cpu_ns;
    return times;
  }

  size_t resident_bytes() const {
    if (daemon_pid_ == 0) return 0;
    const auto usage = usage_of(daemon_pid_);
    return usage ? usage->resident_bytes : 0;
  }

  static std::vector<BenchStream*> pointers(const Streams& streams) {
    std::vector<BenchStream*> all;
    for (const auto& stream : streams) all.push_back(stream.get());
    return all;
  }

  static int64_t settled_until_ns(const Streams& streams) {
    int64_t oldest_ns = std::numeric_limits<int64_t>::max();
    for (const auto& stream : streams) oldest_ns = std::min(oldest_ns, stream->oldest_pending_ns());
    return oldest_ns;
  }

  static Status check_alive(const Streams& streams) {
    for (size_t i = 0; i < streams.size(); ++i)
      if (auto end = streams[i]->end())
        return fail(end->code, end->field,
                    "session " + std::to_string(i + 1) + " ended under the load: " + end->message);
    return {};
  }

  void show_progress() {
    const int64_t total_ns = schedule_.begin_ns(BenchPeer::kDaemon, 0) + to_ns(options_.max_duration_s);
    bar_.show(windows_.empty() ? "warm-up" : "window " + std::to_string(windows_.size()),
              static_cast<size_t>(std::min(since_start_ns(), total_ns) / 1'000'000),
              static_cast<size_t>(total_ns / 1'000'000));
  }

  void close_streams() {
    generator_.reset();
    const auto deadline = std::chrono::steady_clock::now() + kSettleTimeout;  // for all of them
    for (const auto& session : sessions_) {
      const auto left = deadline - std::chrono::steady_clock::now();
      session->close(std::max<std::chrono::nanoseconds>(left, 0ns));
    }
    echoes_.clear();
  }

  Result<BenchResult> finish() {
    bar_.clear();
    close_streams();
    std::this_thread::sleep_for(kAfterwards);
    memory_.after = resident_bytes();
    memory_.session_count = options_.sessions;
    if (daemon_pid_ != 0) result_.memory = memory_;
    for (const auto& session : sessions_) {
      result_.totals += session->counts();
      if (result_.trouble.empty()) result_.trouble = session->trouble();
    }
    describe_load();
    result_.windows_seen = windows_.size();
    const size_t kept = result_.stable ? options_.stable.windows : windows_.size();
    windows_.erase(windows_.begin(), windows_.end() - static_cast<std::ptrdiff_t>(kept));
    summarize(windows_, result_);
    return std::move(result_);
  }

  void describe_load() {
    result_.sampler = opened_.sampler;
    result_.instances = opened_.instances;
    result_.triangles = opened_.triangles;
    result_.sessions = options_.sessions;
    result_.targets = options_.targets;
    result_.moving = options_.moving;
    result_.channels = (options_.sessions - 1) / options_.sessions_per_channel + 1;
    result_.rate_hz = options_.rate_hz;
    result_.window_s = options_.window_s;
  }

  const BenchOptions& options_;
  const BenchSchedule schedule_;
  ProgressBar bar_;
  ScratchFolder scratch_;
  std::vector<std::byte> scene_;
  std::unique_ptr<BenchWorld> world_;
  v1::Settings settings_;
  std::unique_ptr<ChildProcess> daemon_, echo_;
  pid_t daemon_pid_ = 0;
  std::optional<Client> client_;
  std::string scene_hash_;
  BenchOpened opened_;
  std::shared_ptr<grpc::Channel> daemon_channel_;
  const std::unique_ptr<EventLoop> loop_ = std::make_unique<EventLoop>(std::make_unique<grpc::CompletionQueue>());
  Streams sessions_, echoes_;  // each echo speaks as its session does
  std::optional<BenchGenerator> generator_;
  std::vector<MeasuredWindow> windows_;
  CpuSpan daemon_cpu_, echo_cpu_;
  std::vector<Quantiles> round_trips_;  // by window
  BenchMemory memory_;
  BenchResult result_;
};

}  // namespace

Result<BenchResult> run_bench(const BenchOptions& options, std::ostream& err) {
  return Bench(options, err).run();
}

}  // namespace sightline
