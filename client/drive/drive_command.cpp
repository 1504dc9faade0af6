#include "client/drive/drive_command.h"

#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>

#include "client/base/progress_bar.h"
#include "client/base/wire_presets.h"
#include "client/drive/comparison.h"
#include "client/drive/page.h"
#include "client/drive/player.h"
#include "client/drive/report.h"
#include "client/drive/trace.h"
#include "client/page/contact_sheet.h"
#include "client/scenario/scenario_limits.h"
#include "client/scenario/scenario_session.h"
#include "client/shots/named_shots.h"
#include "client/truth/follow.h"
#include "client/truth/metrics.h"
#include "server/base/cpu_budget.h"
#include "server/scene/confined_folder.h"

namespace sightline {
namespace {

using namespace std::chrono_literals;

// Moments that comparison.png shows, and the width of each picture in pixels.
constexpr size_t kComparedFrames = 3;
constexpr int kComparedWidth = 426;

// The figures of one path, and the truth that they come from.
struct Judged {
  std::vector<FrameTruth> truths;
  RunMetrics metrics;
};

class Drive {
 public:
  Drive(const DriveOptions& options, std::ostream& out, std::ostream& err)
      : options_(options), json_out_(out), out_(options.json ? nullptr : out.rdbuf()), bar_(err, options.progress) {}

  Status run() {
    if (auto done = load(); !done) return done;
    if (auto done = steer(); !done) return done;
    if (auto done = judge_run(); !done) return done;
    return write_files();
  }

 private:
  Status load() {
    auto scenario = Scenario::read(options_.scenario, store_);
    if (!scenario) return tl::unexpected(scenario.error());
    scenario_.emplace(std::move(*scenario));
    for (const std::string& warning : scenario_->asset().warnings) warn(warning);
    const auto limits = limits_of(*scenario_);
    if (!limits) return tl::unexpected(limits.error());
    limits_ = *limits;
    auto world = ScenarioWorld::make(*scenario_, store_, device_);
    if (!world) return tl::unexpected(world.error());
    world_ = std::move(*world);
    play_.rate_hz = options_.rate_hz;
    play_.duration_s = options_.duration_s > 0 ? options_.duration_s : scenario_->duration_s();
    play_.lockstep = options_.lockstep;
    play_.on_frame = [this](const auto& frames) { say_frame(frames); };
    // Reported now rather than after the run.
    std::error_code trouble;
    std::filesystem::create_directories(options_.out, trouble);
    if (trouble) return fail(ErrorCode::kUnavailable, options_.out, trouble.message());
    if (!options_.page.empty() && !std::ofstream(options_.page, std::ios::app))
      return fail(ErrorCode::kUnavailable, options_.page, "cannot be written");
    return {};
  }

  Status steer() {
    const auto credentials = read_credentials(options_.connection);
    if (!credentials) return tl::unexpected(credentials.error());
    auto client = Client::connect(options_.server, 5s, {}, *credentials);
    if (!client) return tl::unexpected(client.error());
    auto file = read_whole_file(options_.scenario, SIZE_MAX);
    if (!file) return tl::unexpected(file.error());
    scene_file_ = std::move(*file);
    const auto scene = client->upload_scene(scene_file_, 2min);
    if (!scene) return tl::unexpected(scene.error());
    const auto preset = preset_named(options_.preset);
    if (!preset) return tl::unexpected(preset.error());
    open_ = open_request(*scenario_, scene->hash(), options_.seed);
    open_.mutable_limits()->set_max_speed_mps(limits_.max_speed_mps);
    open_.mutable_limits()->set_max_acceleration_mps2(limits_.max_acceleration_mps2);
    open_.mutable_settings()->set_preset(*preset);
    if (auto asked = ask_for_shot(); !asked) return asked;
    open_.mutable_diagnostics()->set_candidates(!options_.page.empty());
    auto session = client->open_session(open_, 30s);
    if (!session) return tl::unexpected(session.error());
    opened_ = (*session)->opened();
    say_opened(opened_);
    auto frames = play(*scenario_, **session, play_);
    bar_.clear();
    if (!frames) return tl::unexpected(frames.error());
    frames_ = std::move(*frames);
    for (const PlayedFrame& played : frames_) path_.push_back(played.frame);
    return (*session)->close(5s);
  }

  Status ask_for_shot() {
    if (options_.shot.empty()) return {};
    const auto id = [&](int i) { return i < open_.targets_size() ? open_.targets(i).id() : 0; };
    const auto asked = read_shot_text(options_.shot, id(0), id(1));
    if (!asked) return tl::unexpected(asked.error());
    open_.mutable_settings()->MergeFrom(asked->settings());
    if (asked->has_shot()) *open_.mutable_shot() = asked->shot();
    return {};
  }

  void say_opened(const v1::SessionOpened& opened) {
    out_ << "session " << opened.session_id() << ": " << opened.instance_count() << " instances, "
         << opened.triangle_count() << " triangles, " << scenario_->targets().size() << " targets, sampler "
         << opened.sampler() << '\n';
    for (const std::string& warning : opened.warnings()) warn(warning);
  }

  void warn(const std::string& text) {
    warnings_.push_back(text);
    out_ << "warning: " << text << '\n';
  }

  void say_frame(const std::vector<PlayedFrame>& frames) {
    bar_.show("drive", frames.back().reply.sequence(), tick_count(play_));
    const double second = std::floor(frames.back().frame.time_s + 1e-9);
    if (second <= said_second_) return;
    said_second_ = second;
    bar_.clear();
    out_ << summary_line(*scenario_, frames.back()) << std::endl;
  }

  Result<Judged> judge_path(const std::string& what, std::span<const CameraFrame> path) {
    JudgeOptions options;
    options.picture_every = options_.truth ? options_.picture_every : 0;
    options.threads = cpu_budget();
    options.progress = [&](size_t done) { bar_.show(what, done, path.size()); };
    auto truths = judge(*scenario_, store_, device_, path, options);
    bar_.clear();
    if (!truths) return tl::unexpected(truths.error());
    Judged judged{std::move(*truths), {}};
    judged.metrics = summarize(*scenario_, path, judged.truths, limits_);
    return judged;
  }

  Status judge_run() {
    auto run = judge_path("judge", path_);
    if (!run) return tl::unexpected(run.error());
    run_ = std::move(*run);
    if (!options_.truth || world_->targets().empty()) return {};
    follow_path_ = follow_path(*world_, path_);
    auto follow = judge_path("follow", follow_path_);
    if (!follow) return tl::unexpected(follow.error());
    follow_ = std::move(follow->metrics);
    telling_ = telling_frames(follow->truths, run_.truths, kComparedFrames);
    return {};
  }

  Status write_files() {
    print_table(out_, run_.metrics, follow_, frames_);
    const std::filesystem::path folder(options_.out);
    const std::string trace = folder / "trace.csv", metrics = folder / "metrics.json", sheet = folder / "contact.png";
    std::ofstream trace_file(trace), metrics_file(metrics);
    write_trace(trace_file, *scenario_, frames_, run_.truths);
    metrics_file << "{\"sightline\": " << to_json(run_.metrics);
    if (follow_) metrics_file << ", \"follow\": " << to_json(*follow_);
    metrics_file << "}\n";
    if (!trace_file.flush()) return fail(ErrorCode::kUnavailable, trace, "cannot be written");
    if (!metrics_file.flush()) return fail(ErrorCode::kUnavailable, metrics, "cannot be written");
    bar_.show("picture", 0, 1);
    const Status written = write_png(contact_sheet(*world_, path_), sheet);
    bar_.clear();
    if (!written) return written;
    out_ << "trace   " << trace << "\nmetrics " << metrics << "\npicture " << sheet << '\n';
    files_ = {{"trace", trace}, {"metrics", metrics}, {"picture", sheet}};
    if (const Status compared = write_comparison(folder / "comparison.png"); !compared) return compared;
    if (Status paged = options_.page.empty() ? Status() : write_page(); !paged) return paged;
    if (options_.json) write_json();
    return {};
  }

  void write_json() const {
    const Json sightline = Json::parse(to_json(run_.metrics)),
               follow = follow_ ? Json::parse(to_json(*follow_)) : Json();
    const Json json{{"session", opened_.session_id()},
                    {"sampler", opened_.sampler()},
                    {"sightline", sightline},
                    {"follow", follow},
                    {"latency", latency_json(frames_)},
                    {"files", files_},
                    {"warnings", warnings_}};
    // Names come from the scene: what is no text is replaced, not refused.
    json_out_ << json.dump(2, ' ', false, Json::error_handler_t::replace) << '\n';
  }

  Status write_comparison(const std::string& path) {
    if (telling_.empty()) return {};
    std::vector<CameraFrame> theirs, ours;
    for (const size_t i : telling_) {
      theirs.push_back(follow_path_[i]);
      ours.push_back(path_[i]);
    }
    const Picture picture = comparison(*world_, theirs, ours, kComparedWidth);
    if (auto written = write_png(picture, path); !written) return written;
    out_ << "compare " << path << '\n';
    files_["comparison"] = path;
    return {};
  }

  Status write_page() {
    const std::string title = std::filesystem::path(options_.scenario).stem();
    const auto page = drive_page(
        {*scenario_, scene_file_, open_, opened_, play_, frames_, run_.truths, run_.metrics, follow_}, title,
        [&](const char* what, size_t done, size_t of) { bar_.show(what, done, of); });
    bar_.clear();
    if (!page) return tl::unexpected(page.error());
    for (const std::string& text : page->notices) {
      warnings_.push_back(text);
      out_ << "notice  " << text << '\n';
    }
    if (auto written = write_session_page(*page, options_.page); !written) return written;
    out_ << "page    " << options_.page << '\n';
    files_["page"] = options_.page;
    return {};
  }

  using Json = nlohmann::ordered_json;

  const DriveOptions& options_;
  std::ostream& json_out_;
  std::ostream out_;  // text for a person; with --json it goes nowhere
  ProgressBar bar_;
  GeometryStore store_;
  EmbreeDevice device_;
  std::optional<Scenario> scenario_;
  CameraLimits limits_;  // of the scenario
  std::unique_ptr<ScenarioWorld> world_;
  std::vector<std::byte> scene_file_;
  PlayOptions play_;
  double said_second_ = -1.0;
  v1::OpenSession open_;
  v1::SessionOpened opened_;
  std::vector<PlayedFrame> frames_;
  std::vector<CameraFrame> path_, follow_path_;
  std::vector<size_t> telling_;  // indices of the frames that comparison.png shows
  Judged run_;
  std::optional<RunMetrics> follow_;
  std::vector<std::string> warnings_;
  Json files_;
};

}  // namespace

int run_drive_command(const DriveOptions& options, std::ostream& out, std::ostream& err) {
  if (const Status done = Drive(options, out, err).run(); !done) {
    err << "sightline drive: " << to_string(done.error()) << '\n';
    return 1;
  }
  return 0;
}

}  // namespace sightline
