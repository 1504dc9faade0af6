#include "client/recordings/cut_command.h"

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <iostream>
#include <memory>

#include "client/recordings/cut.h"
#include "client/recordings/summary.h"
#include "client/base/text_table.h"
#include "client/recordings/watched_source.h"

namespace sightline {
namespace {

Result<RecordingCut> cut(const CutOptions& options, ProgressBar& bar) {
  const auto source = open_watched(options.file, bar, "cutting");
  if (!source) return tl::unexpected(source.error());
  const auto recording = Recording::open(*source, options.file);
  if (!recording) return tl::unexpected(recording.error());
  const auto sink = create_file_sink(options.out);
  if (!sink) return tl::unexpected(sink.error());
  auto done = cut_recording(*recording, {options.start_s, options.end_s}, **sink);
  // What is no recording is not to be left behind as one.
  std::error_code ignored;
  if (!done) std::filesystem::remove(options.out, ignored);
  return done;
}

}  // namespace

int run_cut_command(const CutOptions& options, std::ostream& out, std::ostream& err) {
  if (!(options.start_s < options.end_s)) {
    err << "--end must be after --start\n";
    return 2;
  }
  ProgressBar bar(err, options.progress);
  const auto done = cut(options, bar);
  bar.clear();
  if (!done) {
    err << error_text(options.file, done.error()) << '\n';
    return 1;
  }
  out << "cut         " << options.out << '\n'
      << "copied      " << grouped(done->messages) << " messages, " << grouped(done->attachments)
      << " attachments\n"
      << "begins      "
      << (done->snapshot_ticks == 0 ? std::string("where the recording begins")
                                  : "after " + grouped(done->snapshot_ticks) + " ticks, folded into one")
      << '\n';
  const bool lost = done->loss.chunks + done->loss.messages > 0;
  if (!lost) return 0;
  err << options.file << ": lost " << loss_text(done->loss) << '\n';
  print_troubles(err, done->loss);
  return 1;
}

Verb add_cut_verb(CLI::App& app) {
  const auto options = std::make_shared<CutOptions>();
  options->progress = isatty(STDERR_FILENO) != 0;
  CLI::App* cut = app.add_subcommand("cut", "Make a part of a recording a recording that stands alone");
  cut->add_option("file", options->file, "A recording")->required();
  cut->add_option("--out", options->out, "The cut: a new file")->required();
  cut->add_option("--start", options->start_s,
                  "From so many seconds after the first message on (default: all of it)")
      ->check(CLI::NonNegativeNumber);
  cut->add_option("--end", options->end_s, "Up to so many seconds after the first message")
      ->check(CLI::NonNegativeNumber);
  return {cut, [options] { return run_cut_command(*options, std::cout, std::cerr); }};
}

}  // namespace sightline
