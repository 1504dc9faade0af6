#include "client/recordings/info_command.h"

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "client/recordings/summary.h"
#include "client/recordings/watched_source.h"

namespace sightline {
namespace {

Result<RecordingSummary> summary_of(const std::string& path, ProgressBar& bar) {
  auto source = open_watched(path, bar, "reading");
  if (!source) return tl::unexpected(std::move(source.error()));
  auto summary = summarise_recording(std::move(*source), path);
  bar.clear();
  return summary;
}

}  // namespace

int run_info_command(const InfoOptions& options, std::ostream& out, std::ostream& err) {
  ProgressBar bar(err, options.progress);
  int status = 0;
  bool first = true;
  for (const std::string& path : options.files) {
    const auto summary = summary_of(path, bar);
    if (!summary) {
      bar.clear();
      err << error_text(path, summary.error()) << '\n';
      status = 1;
      continue;
    }
    if (options.json) {
      // Names come from files: what is no text is replaced, not refused.
      out << json_of(*summary).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) << '\n';
      continue;
    }
    if (!std::exchange(first, false)) out << '\n';
    print_summary(out, *summary);
  }
  return status;
}

Verb add_info_verb(CLI::App& app) {
  const auto options = std::make_shared<InfoOptions>();
  options->progress = isatty(STDERR_FILENO) != 0;
  CLI::App* info = app.add_subcommand("info", "Say what recordings contain");
  info->add_option("files", options->files, "MCAP files")->required();
  info->add_flag("--json", options->json, "One JSON object a line for each file");
  return {info, [options] { return run_info_command(*options, std::cout, std::cerr); }};
}

}  // namespace sightline
