// Measures reading and replaying a long recording: opening it, the first pose, a seek to the middle, and all steps
// again as fast as possible. It reports how much of that last time is not the step itself.
//
//   replay_bench [--minutes 60] [--scene hall] [--preset sightline] [--points -1] [--sampler embree] [--file FILE]
//   [--threads N]
//
// Makes a recording of a scene that repeats, at 60 Hz, and prints the figures. --file keeps the recording; a file that
// exists is used as it is. --points sets Sample.points; -1 keeps the preset's.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "client/base/wire_presets.h"
#include "client/recordings/local_session.h"
#include "client/recordings/writer.h"
#include "client/replay/compare_replies.h"
#include "client/replay/replay.h"
#include "client/scenario/scenario.h"
#include "client/scenario/scenario_session.h"
#include "scenes/catalog.h"
#include "server/gl/software_renderer.h"
#include "server/sample/sampler_choice.h"

namespace sightline {
namespace {

using Clock = std::chrono::steady_clock;

constexpr double kRateHz = 60.0;
constexpr uint64_t kStartNs = 1'700'000'000'000'000'000;

struct Options {
  double minutes = 60.0;
  std::string scene = "hall";
  std::string preset = "sightline";
  int points = -1;
  std::string sampler = "embree";
  std::string file;
  size_t threads = replay_threads();
};

// Processor time of this thread alone, so that other work on the machine does not count.
double processor_seconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

std::unique_ptr<SamplerDevice> make_sampler(const std::string& name, size_t threads) {
  auto chosen = choose_sampler_device(name == "egl" ? SamplerChoice::kEgl : SamplerChoice::kEmbree, {}, threads);
  return chosen ? std::move(chosen->device) : nullptr;
}

// A camera over the same scenario, again and again; at each repetition a cut puts the camera back to its start.
Status make_recording(const Options& options, const std::string& path) {
  const scenes::CatalogEntry* entry = scenes::find_scene(options.scene);
  if (!entry) return fail(ErrorCode::kNotFound, "--scene", "there is no scene " + options.scene);
  const auto glb = entry->make({});
  if (!glb) return tl::unexpected(glb.error());
  const auto sampler = make_sampler(options.sampler, options.threads);
  if (!sampler) return fail(ErrorCode::kUnavailable, "--sampler", "cannot be made");
  LocalWorld world("", *sampler);
  const auto asset = world.scenes.add_uploaded(*glb);
  if (!asset) return tl::unexpected(asset.error());
  const auto scenario = Scenario::from_asset(*asset);
  if (!scenario) return tl::unexpected(scenario.error());
  const std::string hash = to_hex((*asset)->hash);
  v1::OpenSession open = open_request(*scenario, hash, 1);
  open.mutable_settings()->set_preset(preset_named(options.preset).value());
  if (options.points >= 0) open.mutable_tuning()->mutable_sample()->set_points(static_cast<uint32_t>(options.points));
  const auto session = LocalSession::open(open, world);
  if (!session) return tl::unexpected(session.error());
  v1::RecordingInfo info;
  info.set_sampler(sampler->kind());
  info.set_session_id("replay-bench");
  info.set_seed(1);
  info.set_part(1);
  info.set_start_time_ns(kStartNs);
  auto writer = RecordingWriter::create(path, info);
  if (!writer) return tl::unexpected(writer.error());
  Status done = (*writer)->write(open, kStartNs);
  if (done) done = (*writer)->write((*session)->opened(), kStartNs);
  if (done)
    done = (*writer)->attach({"upload/" + hash, {reinterpret_cast<const char*>(glb->data()), glb->size()}}, kStartNs);
  const auto ticks = static_cast<uint64_t>(options.minutes * 60 * kRateHz);
  const auto loop_ticks = std::max<uint64_t>(1, static_cast<uint64_t>(scenario->duration_s() * kRateHz));
  v1::CameraReply reply;
  for (uint64_t i = 0; done && i < ticks; ++i) {
    v1::Tick tick = tick_at(*scenario, i + 1, static_cast<double>(i % loop_ticks) / kRateHz, 1 / kRateHz);
    tick.set_time_s(static_cast<double>(i) / kRateHz);
    if (i > 0 && i % loop_ticks == 0) {
      *tick.mutable_observed_camera()->mutable_pose() = open.camera();
      tick.mutable_observed_camera()->set_cut(true);
    }
    const uint64_t log_ns = kStartNs + static_cast<uint64_t>(static_cast<double>(i + 1) * 1e9 / kRateHz);
    v1::TickError rejection;
    if (!(*session)->apply(tick, rejection)) return fail(ErrorCode::kInternal, "tick", rejection.message());
    if (Status stepped = (*session)->step(0, reply); !stepped) return stepped;
    done = (*writer)->write(tick, log_ns);
    if (done) done = (*writer)->write(reply, log_ns + 1'000'000);
  }
  return done ? (*writer)->finish() : done;
}

struct Spread {
  std::vector<double> values;
  double median() {
    std::sort(values.begin(), values.end());
    return values[values.size() / 2];
  }
};

// Reads the file alone, from opening it to having a pose at `at_s`.
void time_first_pose(const std::string& path, const char* what, double at_s) {
  constexpr int kTimes = 9;
  Spread open_s, pose_s;
  uint64_t chunks = 0, all_chunks = 0, sequence = 0;
  for (int i = 0; i < kTimes; ++i) {
    const auto start = Clock::now();
    const auto recording = Recording::open(path);
    if (!recording) return;
    open_s.values.push_back(seconds_since(start));
    const RecordedReport report = recording->read({.start_s = at_s}, [&](RecordedEvent& event) {
      if (event.topic != RecordTopic::kReply) return true;
      sequence = std::get<v1::CameraReply>(event.message).sequence();
      return false;
    });
    pose_s.values.push_back(seconds_since(start));
    chunks = report.chunks_read;
    all_chunks = recording->container().chunks.size();
  }
  std::printf("%-22s open %.4f s, first pose after %.4f s (medians of %d), reply %lu, %lu of %lu chunks read\n", what,
              open_s.median(), pose_s.median(), kTimes, static_cast<unsigned long>(sequence),
              static_cast<unsigned long>(chunks), static_cast<unsigned long>(all_chunks));
}

void time_reading(const Recording& recording) {
  const auto start = Clock::now();
  StepSource source(recording);
  RecordedStep step;
  uint64_t steps = 0;
  while (source.next(step)) ++steps;
  const double s = seconds_since(start);
  std::printf("%-22s %.2f s, %.1f us a step, %.0f times real time\n", "read alone", s,
              1e6 * s / static_cast<double>(steps), recording.duration_s() / s);
}

void time_hashing(const Recording& recording) {
  std::vector<v1::CameraReply> replies;
  StepSource source(recording);
  RecordedStep step;
  while (replies.size() < 3000 && source.next(step)) replies.push_back(std::move(step.reply));
  const auto start = Clock::now();
  uint64_t hash = 0;
  PlainReply plain;
  for (const v1::CameraReply& reply : replies)
    hash = hash64_bytes(std::as_bytes(std::span(plain.bytes_of(reply))), hash);
  std::printf("%-22s %.2f us a reply (%016lx)\n", "plain bytes and hash",
              1e6 * seconds_since(start) / static_cast<double>(replies.size()), static_cast<unsigned long>(hash));
}

// Sums over steps.
struct StageTimes {
  double total_us = 0.0, scene_us = 0.0, bound_us = 0.0, sample_us = 0.0, aggregate_us = 0.0, move_us = 0.0;
  void add(const v1::StageTimes& step) {
    total_us += step.total_us(), scene_us += step.scene_us(), bound_us += step.bound_us();
    sample_us += step.sample_us(), aggregate_us += step.aggregate_us(), move_us += step.move_us();
  }
};

Status time_replay(const Recording& recording, size_t threads) {
  auto sampler = make_sampler(recording.info().sampler(), threads);
  if (!sampler) return fail(ErrorCode::kUnavailable, "--sampler", "cannot be made");
  const auto place = make_local_backend(std::move(sampler));
  SceneFiles scenes(recording, {});
  Replay replay(recording, *place, scenes, {});
  const auto start = Clock::now();
  if (Status opened = replay.open(); !opened) return opened;
  const double open_s = seconds_since(start);
  ReplyComparison comparison(replay.convention());
  ReplayedStep step;
  uint64_t steps = 0;
  StageTimes stages;
  const double processor_s = processor_seconds();
  const auto begun = Clock::now();
  while (true) {
    const auto more = replay.next(step);
    if (!more) return tl::unexpected(more.error());
    if (!*more) break;
    ++steps;
    stages.add(step.answer.reply.stage_times());
    if (step.recorded.answer == StepAnswer::kRecorded && step.answer.has_reply)
      comparison.add(step.recorded.step.reply, step.answer.reply);
  }
  const double on_processor_s = processor_seconds() - processor_s, s = seconds_since(begun),
               n = static_cast<double>(steps);
  std::printf("%-22s open %.2f s; %lu steps in %.1f s: %.0f a second, %.1f times real time; %lu equal\n", "replay",
              open_s, static_cast<unsigned long>(steps), s, n / s, recording.duration_s() / s,
              static_cast<unsigned long>(comparison.equal()));
  std::printf(
      "%-22s %.1f us a step, of which the step itself %.1f, all else %.1f; %.1f us of processor "
      "time: %.1f times real time on a core of its own\n",
      "", 1e6 * s / n, stages.total_us / n, 1e6 * s / n - stages.total_us / n, 1e6 * on_processor_s / n,
      recording.duration_s() / on_processor_s);
  std::printf("%-22s scene %.1f, bound %.1f, sample %.1f, aggregate %.1f, move %.1f us\n", "", stages.scene_us / n,
              stages.bound_us / n, stages.sample_us / n, stages.aggregate_us / n, stages.move_us / n);
  return {};
}

Status run(const Options& options) {
  const std::string path = options.file.empty()
                               ? (std::filesystem::temp_directory_path() / "replay_bench.mcap").string()
                               : options.file;
  if (options.file.empty()) std::filesystem::remove(path);
  if (!std::filesystem::exists(path)) {
    const auto start = Clock::now();
    if (Status made = make_recording(options, path); !made) return made;
    std::printf("%-22s %.1f minutes in %.1f s\n", "made", options.minutes, seconds_since(start));
  }
  const auto recording = Recording::open(path);
  if (!recording) return tl::unexpected(recording.error());
  std::printf("%-22s %.1f s, %.1f MiB, %zu chunks, %s\n", "recording", recording->duration_s(),
              static_cast<double>(std::filesystem::file_size(path)) / (1 << 20), recording->container().chunks.size(),
              recording->info().sampler().c_str());
  time_first_pose(path, "from the start", 0.0);
  time_first_pose(path, "from the middle", recording->duration_s() / 2);
  time_reading(*recording);
  time_hashing(*recording);
  if (Status done = time_replay(*recording, options.threads); !done) return done;
  if (options.file.empty()) std::filesystem::remove(path);
  return {};
}

}  // namespace
}  // namespace sightline

int main(int argc, char** argv) {
  sightline::prepare_software_rendering();
  sightline::Options options;
  CLI::App app("What a long recording costs who reads and replays it");
  app.add_option("--minutes", options.minutes, "Of the recording that is made")
      ->check(CLI::Range(0.01, 1e4))
      ->capture_default_str();
  app.add_option("--scene", options.scene, "Of the catalogue")->capture_default_str();
  app.add_option("--preset", options.preset, "That the settings start from")
      ->check(CLI::IsMember(sightline::preset_names()))
      ->capture_default_str();
  app.add_option("--points", options.points, "Surface points of each target; -1: the preset's")
      ->check(CLI::Range(-1, 16));
  app.add_option("--sampler", options.sampler, "embree or egl")
      ->check(CLI::IsMember({"embree", "egl"}))
      ->capture_default_str();
  app.add_option("--file", options.file, "Keep the recording here, or take the one that is here");
  app.add_option("--threads", options.threads, "That a replay takes its maps on")
      ->check(CLI::Range(size_t{1}, size_t{64}))
      ->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  if (const sightline::Status done = sightline::run(options); !done) {
    std::fprintf(stderr, "replay_bench: %s\n", to_string(done.error()).c_str());
    return 1;
  }
  return 0;
}
