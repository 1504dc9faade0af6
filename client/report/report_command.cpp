#include "client/report/report_command.h"

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "client/base/progress_bar.h"
#include "client/page/side_by_side.h"
#include "server/sample/embree_sampler.h"
#include "server/sample/sampler_choice.h"

namespace sightline {
namespace {

const std::map<std::string, PageCells> kCells = {
    {"auto", PageCells::kAuto}, {"recorded", PageCells::kRecorded}, {"none", PageCells::kNone}};

// Returns a sampler of the recording's kind when this machine has it. Otherwise one that can open the session, but
// whose steps are not comparable.
std::unique_ptr<SamplerDevice> sampler_like(const std::string& kind, PageCells cells) {
  if (kind == "egl" && cells == PageCells::kAuto)
    if (auto egl = choose_sampler_device(SamplerChoice::kEgl, {})) return std::move(egl->device);
  return make_embree_sampler_device();
}

std::string page_path(const ReportOptions& options) {
  if (!options.out.empty()) return options.out;
  return std::filesystem::path(options.recording).replace_extension(".html").string();
}

Result<SessionPage> page_of(const std::string& file, const ReportOptions& options, ProgressBar& bar) {
  const auto recording = Recording::open(file);
  if (!recording) return tl::unexpected(recording.error());
  RecordingPageOptions page_options = options.page;
  page_options.progress = [&](const char* what, size_t done, size_t of) { bar.show(what, done, of); };
  const auto sampler = sampler_like(recording->info().sampler(), options.page.cells);
  auto page = recording_page(*recording, page_options, *sampler);
  bar.clear();
  return page;
}

// Size and notices of a page, without its contents.
struct PageSummary {
  std::string recording;
  std::vector<std::string> notices;
  size_t frames = 0, pictures = 0;
};

PageSummary summary_of(const std::string& recording, const SessionPage& page) {
  return {recording, page.notices, page.frames.size(), page.pictures.size()};
}

void print(const std::string& path, const std::vector<PageSummary>& summaries, std::ostream& out) {
  for (const PageSummary& summary : summaries) {
    for (const std::string& text : summary.notices) out << "notice  " << text << '\n';
    out << "frames  " << summary.frames << ", pictures " << summary.pictures << '\n';
  }
  out << "page    " << path << '\n';
}

void print_json(const std::string& path, const std::vector<PageSummary>& summaries, std::ostream& out) {
  nlohmann::ordered_json json{{"page", path}, {"recordings", nlohmann::ordered_json::array()}};
  for (const PageSummary& summary : summaries)
    json["recordings"].push_back({{"file", summary.recording},
                                  {"frames", summary.frames},
                                  {"pictures", summary.pictures},
                                  {"notices", summary.notices}});
  out << json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) << '\n';
}

Result<std::string> report_html(const ReportOptions& options, std::vector<PageSummary>& summaries, ProgressBar& bar) {
  auto page = page_of(options.recording, options, bar);
  if (!page) return tl::unexpected(page.error());
  summaries.push_back(summary_of(options.recording, *page));
  if (!options.beside.empty())
    page->title.append(": ").append(std::filesystem::path(options.recording).filename().string());
  auto html = session_page(*page);
  if (!html || options.beside.empty()) return html;
  auto other = page_of(options.beside, options, bar);
  if (!other) return tl::unexpected(other.error());
  summaries.push_back(summary_of(options.beside, *other));
  other->title.append(": ").append(std::filesystem::path(options.beside).filename().string());
  const auto right = session_page(*other);
  if (!right) return right;
  return side_by_side_page(page->title + " | " + other->title, *html, *right);
}

Status write_report(const ReportOptions& options, std::ostream& out, ProgressBar& bar) {
  const std::string path = page_path(options);
  // Fails now rather than after the work.
  const bool is_new = !std::filesystem::exists(path);
  std::ofstream file(path, std::ios::app | std::ios::binary);
  if (!file) return fail(ErrorCode::kUnavailable, path, "cannot be written");
  file.close();
  std::vector<PageSummary> summaries;
  const auto html = report_html(options, summaries, bar);
  std::error_code ignored;
  if (!html && is_new) std::filesystem::remove(path, ignored);
  if (!html) return tl::unexpected(html.error());
  std::ofstream page(path, std::ios::trunc | std::ios::binary);
  if (!(page << *html).flush()) return fail(ErrorCode::kUnavailable, path, "cannot be written");
  options.json ? print_json(path, summaries, out) : print(path, summaries, out);
  return {};
}

}  // namespace

int run_report_command(const ReportOptions& options, std::ostream& out, std::ostream& err) {
  ProgressBar bar(err, options.progress);
  const Status done = write_report(options, out, bar);
  bar.clear();
  if (!done) err << "sightline report: " << to_string(done.error()) << '\n';
  return done ? 0 : 1;
}

Verb add_report_verb(CLI::App& app) {
  auto options = std::make_shared<ReportOptions>();
  options->progress = isatty(STDERR_FILENO) != 0;
  CLI::App* report = app.add_subcommand("report",
                                        "Write a recording as one HTML page: 3D view, time line, what the camera saw");
  report->add_option("recording", options->recording, "A recording (.mcap)")->required()->check(CLI::ExistingFile);
  report->add_option("beside", options->beside, "A second recording, shown beside the first at the same time")
      ->check(CLI::ExistingFile);
  report->add_option("--out", options->out, "The page (default: beside the recording, .html)");
  report
      ->add_option("--start", options->page.range.start_s, "Seconds since the recording's start: frames from there on")
      ->check(CLI::NonNegativeNumber);
  report->add_option("--end", options->page.range.end_s, "Frames before this")->check(CLI::NonNegativeNumber);
  report->add_option("--scene-dir", options->page.scenes.folder, "Where scene files are that are not attached")
      ->check(CLI::ExistingDirectory);
  report->add_option("--scene", options->page.scenes.files, "A scene file that was uploaded; may be repeated")
      ->allow_extra_args(false)
      ->check(CLI::ExistingFile);
  report
      ->add_option("--cells", options->page.cells,
                   "Candidate cells. auto: as recorded, else every step is taken again and its cells are "
                   "used as long as "
                   "replies are equal; recorded: none unless recorded; none")
      ->transform(CLI::CheckedTransformer(kCells, CLI::ignore_case));
  report->add_option("--pictures", options->page.pictures, "How many pictures of what the camera saw")
      ->check(CLI::Range(0, 1000))
      ->capture_default_str();
  report->add_option("--max-frames", options->page.max_frames, "Replies beyond this are thinned; changes and cuts stay")
      ->check(CLI::Range(2, 1'000'000))
      ->capture_default_str();
  report->add_flag("--json", options->json,
                   "One JSON object instead of text: the page, and frames, pictures and notices of each recording");
  return {report, [options] { return run_report_command(*options, std::cout, std::cerr); }};
}

}  // namespace sightline
