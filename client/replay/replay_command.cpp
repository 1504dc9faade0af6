#include "client/replay/replay_command.h"

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <thread>

#include "client/base/progress_bar.h"
#include "client/base/text_table.h"
#include "client/recordings/reply_fields.h"
#include "client/recordings/writer.h"
#include "client/replay/replay.h"
#include "client/replay/result.h"
#include "client/replay/truth.h"
#include "client/report/figures.h"
#include "server/wire/short_name.h"

namespace sightline {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

// Writes the replies of a replay as a new recording, at the log times of the old one.
class ReplayOutput {
 public:
  static Result<std::unique_ptr<ReplayOutput>> create(const std::string& path, const Recording& recording,
                                                      const Replay& replay) {
    v1::RecordingInfo info = recording.info();
    info.set_server_version(SIGHTLINE_VERSION);
    info.set_build(std::string("replay, compiler ").append(__VERSION__));
    info.set_sampler(replay.opened().sampler());
    info.set_seed(replay.asked().seed());
    auto writer = RecordingWriter::create(path, info);
    if (!writer) return tl::unexpected(std::move(writer.error()));
    std::unique_ptr<ReplayOutput> output(new ReplayOutput(std::move(*writer)));
    const uint64_t start_ns = recording.start_ns();
    Status done = output->writer_->write(replay.asked(), start_ns);
    if (done) done = output->writer_->write(replay.opened(), start_ns);
    if (done) done = output->attach(recording, start_ns);
    if (!done) return tl::unexpected(std::move(done.error()));
    return output;
  }

  Status write(const ReplayedStep& step) {
    const RecordedStep& recorded = step.recorded.step;
    Status done;
    for (size_t i = 0; done && i < recorded.ticks.size(); ++i) {
      done = writer_->write(recorded.ticks[i], recorded.tick_log_ns[i]);
      for (const v1::TickError& rejection : step.answer.rejections)
        if (done && rejection.sequence() == recorded.ticks[i].sequence())
          done = writer_->write(rejection, recorded.tick_log_ns[i]);
    }
    if (done && step.answer.has_reply)
      done = writer_->write(step.answer.reply, std::max(recorded.log_ns, step.log_ns()));
    return done;
  }

  Status finish() { return writer_->finish(); }

 private:
  explicit ReplayOutput(std::unique_ptr<RecordingWriter> writer) : writer_(std::move(writer)) {}

  Status attach(const Recording& recording, uint64_t log_ns) {
    const auto files = recording.files();
    if (!files) return tl::unexpected(files.error());
    for (const RecordedFile& file : *files)
      if (Status done = writer_->attach(file, log_ns); !done) return done;
    return {};
  }

  const std::unique_ptr<RecordingWriter> writer_;
};

class Command {
 public:
  Command(const ReplayCommandOptions& options, std::istream& in, std::ostream& out, std::ostream& err)
      : options_(options),
        in_(in),
        json_out_(out),
        out_(options.json ? nullptr : out.rdbuf()),
        bar_(err, options.progress) {}

  Result<int> run() {
    if (Status done = prepare(); !done) return tl::unexpected(done.error());
    say_what();
    if (Status done = play(); !done) return tl::unexpected(done.error());
    bar_.clear();
    if (output_)
      if (Status done = output_->finish(); !done) return tl::unexpected(done.error());
    return report();
  }

 private:
  Status prepare() {
    for (const std::string& text : options_.set) {
      auto setting = read_replay_setting(text);
      if (!setting) return tl::unexpected(std::move(setting.error()));
      settings_.push_back(std::move(*setting));
    }
    auto recording = Recording::open(options_.file);
    if (!recording) return tl::unexpected(std::move(recording.error()));
    recording_.emplace(std::move(*recording));
    if (Status done = make_backend(); !done) return done;
    scenes_.emplace(*recording_, scene_options(!options_.server.empty()));
    replay_.emplace(*recording_, *backend_, *scenes_, settings_);
    if (options_.truth && !is_local()) {
      mirror_ = make_mirror_backend();
      mirror_scenes_.emplace(*recording_, scene_options(false));
      replay_->mirror_on(*mirror_, *mirror_scenes_);
    }
    if (Status done = replay_->open(); !done) return done;
    result_.emplace(replay_->convention(), never_equal(), reply_fields_unknown_to(recording_->container()));
    if (!settings_.empty() || options_.truth) {
      recorded_figures_.emplace(replay_->convention());
      replayed_figures_.emplace(replay_->convention());
    }
    if (options_.truth) truth_.emplace(options_.truth_every);
    if (options_.out.empty()) return {};
    auto output = ReplayOutput::create(options_.out, *recording_, *replay_);
    if (!output) return tl::unexpected(std::move(output.error()));
    output_ = std::move(*output);
    return {};
  }

  bool is_local() const { return options_.server.empty(); }

  SceneFileOptions scene_options(bool may_be_there) const {
    return {.folder = options_.scene_dir, .files = options_.scenes, .may_be_there = may_be_there};
  }

  Status make_backend() {
    if (!is_local()) {
      const std::chrono::duration<double> wait(options_.wait_s);
      const auto credentials = read_credentials(options_.connection);
      if (!credentials) return tl::unexpected(credentials.error());
      auto backend = connect_backend(options_.server, std::chrono::duration_cast<std::chrono::nanoseconds>(wait),
                                     *credentials);
      if (!backend) return tl::unexpected(std::move(backend.error()));
      backend_ = std::move(*backend);
      return {};
    }
    const std::string wanted = options_.sampler == "recorded" ? recording_->info().sampler() : options_.sampler;
    const SamplerChoice choice = wanted == "egl"      ? SamplerChoice::kEgl
                                 : wanted == "embree" ? SamplerChoice::kEmbree
                                                      : SamplerChoice::kAuto;
    auto sampler = choose_sampler_device(choice, {}, options_.threads > 0 ? options_.threads : replay_threads());
    if (!sampler) {
      Error error = std::move(sampler.error());
      if (options_.sampler == "recorded") error.message += "; --sampler embree needs no OpenGL";
      return tl::unexpected(std::move(error));
    }
    sampler_text_ = sampler->device->renderer();
    backend_ = make_local_backend(std::move(sampler->device));
    return {};
  }

  // The reason why replies need not be equal; empty: they must be equal.
  std::string never_equal() const {
    if (!settings_.empty()) return kOtherSettings;
    if (replay_->opened().sampler() != recording_->info().sampler())
      return "recorded with " + recording_->info().sampler() + ", replayed with " + replay_->opened().sampler();
    return {};
  }

  void say_what() {
    const v1::RecordingInfo& info = recording_->info();
    out_ << "recording   " << options_.file << ": session " << info.session_id() << ", seed " << info.seed() << ", "
         << info.sampler() << formatted(", %.2f s", recording_->duration_s());
    if (!info.server_version().empty()) out_ << ", by " << info.server_version();
    out_ << "\nreplay      " << (is_local() ? "in this process" : "at " + options_.server) << ", "
         << replay_->opened().sampler();
    if (!sampler_text_.empty()) out_ << " (" << sampler_text_ << ")";
    out_ << '\n';
    for (const std::string& warning : replay_->opened().warnings()) out_ << "warning     " << warning << '\n';
    if (!recording_->container().finished)
      out_ << "note        the file was not finished: the last messages are missing\n";
    for (const std::string& text : options_.set) out_ << "set         " << text << '\n';
    if (options_.start_s > 0)
      out_ << formatted(
          "start       at %.3f s; everything before is stepped as fast as possible, so that the session's "
          "state is exact\n",
          options_.start_s);
  }

  Status play() {
    began_ = Clock::now();
    const auto offset_s = [&](uint64_t log_ns) {
      return static_cast<double>(static_cast<int64_t>(log_ns - recording_->start_ns())) * 1e-9;
    };
    bool started = false;
    while (const auto log_ns = replay_->next_log_ns()) {
      const double at_s = offset_s(*log_ns);
      if (at_s >= options_.end_s) break;
      if (!started && at_s >= options_.start_s) {
        started = true;
        say_started(at_s);
      }
      if (started && options_.rate) wait_until_due(at_s);
      if (started && options_.by_hand && !ask_for_step()) break;
      auto more = replay_->next(step_);
      if (!more) return tl::unexpected(std::move(more.error()));
      if (Status taken = take_step(); !taken) return taken;
      say_restart();
      if (started && options_.by_hand) say_step();
      played_s_ = at_s;
      bar_.show("replay", static_cast<size_t>(1000 * std::max(0.0, at_s)), static_cast<size_t>(1000 * length_s()) + 1);
    }
    took_s_ = seconds_since(began_);
    return {};
  }

  double length_s() const { return std::min(options_.end_s, recording_->duration_s()); }

  void say_started(double at_s) {
    paced_from_ = Clock::now();
    paced_from_s_ = at_s;
    if (options_.start_s <= 0) return;
    bar_.clear();
    out_ << formatted("started     %.3f s of the recording were stepped in %.2f s\n", at_s, seconds_since(began_))
         << std::flush;
  }

  void wait_until_due(double at_s) {
    const std::chrono::duration<double> after((at_s - paced_from_s_) / *options_.rate);
    std::this_thread::sleep_until(paced_from_ + std::chrono::duration_cast<Clock::duration>(after));
  }

  // Enter: one step. "n 10": ten steps. "q" or the end of the input: stop.
  bool ask_for_step() {
    while (steps_granted_ == 0) {
      bar_.clear();
      out_ << "step> " << std::flush;
      std::string line, word;
      if (!std::getline(in_, line)) return false;
      std::istringstream words(line);
      if (!(words >> word)) {
        steps_granted_ = 1;
      } else if (word == "q") {
        return false;
      } else if (word != "n" || !(words >> steps_granted_)) {
        steps_granted_ = 0;
        out_ << "Enter: one step; n 10: ten steps; q: stop\n";
      }
    }
    --steps_granted_;
    return true;
  }

  Status take_step() {
    result_->excuse(replay_->inexact());
    result_->add(step_);
    if (!step_.recorded.step.ticks.empty()) {
      last_game_s_ = step_.recorded.step.ticks.back().time_s();
      if (!first_game_s_) first_game_s_ = last_game_s_;
    }
    if (output_)
      if (Status written = output_->write(step_); !written) return written;
    if (step_.recorded.answer != StepAnswer::kRecorded || !step_.answer.has_reply) return {};
    if (recorded_figures_) {
      for (const v1::Tick& tick : step_.recorded.step.ticks)
        recorded_figures_->take(tick), replayed_figures_->take(tick);
      recorded_figures_->add(step_.recorded.step.reply);
      replayed_figures_->add(step_.answer.reply);
    }
    if (truth_)
      truth_->add(*(mirror_ ? *mirror_ : *backend_).session(), replay_->feed().recorded_limits(),
                  step_.recorded.step.reply, step_.answer.reply);
    return {};
  }

  double played_game_s() const { return first_game_s_ ? last_game_s_ - *first_game_s_ : 0.0; }

  void say_restart() {
    if (replay_->restarts() == restarts_told_) return;
    restarts_told_ = replay_->restarts();
    bar_.clear();
    out_ << formatted(
                "restart     the server was gone at tick %lu; the session was opened again and all steps were "
                "repeated: %s\n",
                static_cast<unsigned long>(step_.answer.reply.sequence()),
                replay_->restarts_equal() ? "the same replies" : "not the same replies")
         << std::flush;
  }

  void say_step() {
    const v1::CameraReply& reply = step_.answer.reply;
    if (!step_.answer.has_reply) {
      out_ << "no reply";
      for (const v1::TickError& rejection : step_.answer.rejections)
        out_ << "; tick " << rejection.sequence() << " refused: " << rejection.message();
      out_ << '\n';
      return;
    }
    const auto& p = reply.pose().position();
    out_ << formatted("tick %lu  %.3f s  (%.3f, %.3f, %.3f)", static_cast<unsigned long>(reply.sequence()),
                      reply.time_s(), p.x(), p.y(), p.z());
    for (const auto& target : reply.targets())
      out_ << formatted("  %lu %.2f", static_cast<unsigned long>(target.id()), target.visible_share());
    out_ << formatted("  S_V %u of %u  ", reply.candidate_counts().all_visible(), reply.candidate_counts().total())
         << short_name(reply.status()) << ' ' << short_name(reply.reason());
    if (step_.recorded.answer == StepAnswer::kRecorded)
      out_ << (reply_hash(reply) == reply_hash(step_.recorded.step.reply) ? "  equal" : "  differs");
    out_ << '\n' << std::flush;
  }

  // Both runs side by side; nothing unless settings were changed or the truth was judged.
  std::vector<FigureRow> figures() {
    if (!recorded_figures_) return {};
    const ReplyFigures* const runs[] = {&*recorded_figures_, &*replayed_figures_};
    std::vector<FigureRow> rows = reply_rows(runs);
    if (truth_)
      for (FigureRow& row : truth_->rows()) rows.push_back({"true: " + row.label, std::move(row.values)});
    return rows;
  }

  void print_json() {
    nlohmann::ordered_json json{{"recording", options_.file},
                                {"session", recording_->info().session_id()},
                                {"sampler", replay_->opened().sampler()},
                                {"set", options_.set},
                                {"seconds", took_s_},
                                {"result", result_->json()},
                                {"figures", nlohmann::ordered_json::array()},
                                {"written", options_.out}};
    for (const FigureRow& row : figures())
      json["figures"].push_back({{"name", row.label}, {"recorded", row.values[0]}, {"replayed", row.values[1]}});
    json_out_ << json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) << '\n';
  }

  int report() {
    const uint64_t replies = result_->replies().compared();
    const double took_s = std::max(took_s_, 1e-9);
    out_ << formatted(
        "speed       %lu replies in %.2f s: %.0f a second, %.1f times the wall clock of the recording, %.1f times "
        "the game's clock\n",
        static_cast<unsigned long>(replies), took_s_, static_cast<double>(replies) / took_s, played_s_ / took_s,
        played_game_s() / took_s);
    if (!settings_.empty())
      out_ << "observed    " << replay_->feed().observed_left_out()
           << " cameras that only followed the recorded replies left out, " << replay_->feed().observed_kept()
           << " kept\n";
    result_->print(out_);
    if (recorded_figures_) {
      const std::vector<std::string> columns{"recorded", "replayed"};
      print_rows(out_, columns, figures());
      if (truth_) out_ << "true: " << truth_->pictures() << " pictures of each judged by a 512 x 512 re-render\n";
    }
    if (output_) out_ << "written     " << options_.out << '\n';
    if (options_.json) print_json();
    const ReplayVerdict verdict = result_->verdict();
    const bool good = verdict == ReplayVerdict::kEqual || verdict == ReplayVerdict::kAlike;
    return good || (!settings_.empty() && verdict == ReplayVerdict::kDiffers) ? 0 : 1;
  }

  const ReplayCommandOptions& options_;
  std::istream& in_;
  std::ostream& json_out_;
  std::ostream out_;  // text for a person; with --json it goes nowhere
  ProgressBar bar_;
  std::vector<ReplaySetting> settings_;
  std::optional<Recording> recording_;
  std::string sampler_text_;
  std::unique_ptr<ReplayBackend> backend_, mirror_;
  std::optional<SceneFiles> scenes_, mirror_scenes_;
  std::optional<Replay> replay_;
  std::optional<ReplayResult> result_;
  std::optional<ReplyFigures> recorded_figures_, replayed_figures_;
  std::optional<ReplayTruth> truth_;
  std::unique_ptr<ReplayOutput> output_;
  ReplayedStep step_;
  Clock::time_point began_, paced_from_;
  double paced_from_s_ = 0.0, played_s_ = 0.0, took_s_ = 0.0;
  std::optional<double> first_game_s_;
  double last_game_s_ = 0.0;
  uint64_t steps_granted_ = 0, restarts_told_ = 0;
};

}  // namespace

int run_replay_command(const ReplayCommandOptions& options, std::istream& in, std::ostream& out, std::ostream& err) {
  const Result<int> done = Command(options, in, out, err).run();
  if (done) return *done;
  err << "sightline replay: " << to_string(done.error()) << '\n';
  return 1;
}

Verb add_replay_verb(CLI::App& app) {
  const auto options = std::make_shared<ReplayCommandOptions>();
  options->progress = isatty(STDERR_FILENO) != 0;
  CLI::App* command = app.add_subcommand("replay",
                                         "Take the steps of a recording again and compare the replies; "
                                         "with --set, show what other settings change");
  command->add_option("file", options->file, "A recording (.mcap)")->required()->check(CLI::ExistingFile);
  CLI::Option* server = command->add_option("--server,--address", options->server,
                                            "host:port or unix:/path of a daemon (default: in this process)");
  add_connection_flags(*command, options->connection);
  command->add_option("--wait", options->wait_s, "Seconds to wait for a daemon that is not there, or went away")
      ->check(CLI::Range(0.0, 86400.0))
      ->capture_default_str();
  CLI::Option* rate = command
                          ->add_option("--rate", options->rate,
                                       "Times real time: 1, 0.5, ... (default: as fast as possible)")
                          ->check(CLI::Range(1e-3, 1e6));
  CLI::Option* step = command->add_flag("--step", options->by_hand,
                                        "Step by step: Enter takes one step, `n 10` ten, `q` ends");
  step->excludes(rate);
  command
      ->add_option("--start", options->start_s,
                   "Seconds of the recording; everything before is stepped as fast as possible")
      ->check(CLI::Range(0.0, 1e9));
  command->add_option("--end", options->end_s, "Seconds of the recording")->check(CLI::Range(0.0, 1e9));
  command->add_option("--sampler", options->sampler, "recorded, auto, egl or embree")
      ->check(CLI::IsMember({"recorded", "auto", "egl", "embree"}))
      ->capture_default_str()
      ->excludes(server);
  command
      ->add_option("--threads", options->threads,
                   "Threads that take the maps of a step, of Embree (default: one a core, at most 4)")
      ->check(CLI::Range(size_t{1}, size_t{64}))
      ->excludes(server);
  command->add_option("--scene-dir", options->scene_dir, "Folder of the scenes that are not attached")
      ->check(CLI::ExistingDirectory);
  command->add_option("--scene", options->scenes, "A scene file that is not attached; may be repeated")
      ->check(CLI::ExistingFile)
      ->allow_extra_args(false);
  command
      ->add_option(
          "--set", options->set,
          "KEY=VALUE: another setting on the same input, e.g. max_distance_m=8, preset=PAPER, tuning.sample.points=4, "
          "limits.max_speed_mps=3, "
          "lens.near_m=0.2, seed=2; prints both runs side by side; may be repeated")
      ->allow_extra_args(false);
  command->add_flag("--truth", options->truth, "Judge both cameras' pictures by a 512 x 512 re-render");
  command->add_option("--truth-every", options->truth_every, "Judge the picture of every n-th step")
      ->check(CLI::Range(size_t{1}, size_t{1000000}))
      ->capture_default_str();
  command->add_option("--out", options->out, "Write the new replies to this new recording");
  command->add_flag("--json", options->json, "One JSON object instead of text; `figures` are texts with their units")
      ->excludes(step);
  return {command, [options] { return run_replay_command(*options, std::cin, std::cout, std::cerr); }};
}

}  // namespace sightline
