#include "client/recordings/recover_command.h"

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>

#include "client/recordings/summary.h"
#include "client/base/text_table.h"
#include "client/recordings/watched_source.h"
#include "server/record/mcap_recover.h"
#include "server/record/mcap_verify.h"

namespace sightline {
namespace {

std::optional<mcap::Metadata> note_of(const McapRecovery& done) {
  if (done.loss.none() && done.was_finished) return std::nullopt;
  std::string lost = loss_text(done.loss);
  if (!done.was_finished) lost.append("; its end was missing");
  return mcap::Metadata{kRecoveredMetadata,
                        {{"lost", lost},
                         {"chunks", std::to_string(done.loss.chunks)},
                         {"messages", std::to_string(done.loss.messages)},
                         {"bytes", std::to_string(done.loss.bytes)},
                         {"was_finished", done.was_finished ? "true" : "false"}}};
}

Result<McapRecovery> recover(const RecoverOptions& options, ProgressBar& bar) {
  const auto source = open_watched(options.file, bar, "recovering");
  if (!source) return tl::unexpected(source.error());
  const auto sink = create_file_sink(options.out);
  if (!sink) return tl::unexpected(sink.error());
  auto done = recover_mcap(**source, **sink, {}, {}, note_of);
  // What is no recording is not to be left behind as one.
  std::error_code ignored;
  if (!done) std::filesystem::remove(options.out, ignored);
  return done;
}

// The proof of it: the copy, read as any other file.
Status check_copy(const std::string& path, ProgressBar& bar) {
  const auto source = open_watched(path, bar, "verifying");
  if (!source) return tl::unexpected(source.error());
  const auto verdict = verify_mcap(**source, {});
  if (!verdict) return tl::unexpected(verdict.error());
  if (verdict->sound()) return {};
  return fail(ErrorCode::kInternal, path, "the copy is not sound");
}

}  // namespace

int run_recover_command(const RecoverOptions& options, std::ostream& out, std::ostream& err) {
  ProgressBar bar(err, options.progress);
  const auto done = recover(options, bar);
  const Status sound = done ? check_copy(options.out, bar) : Status{};
  bar.clear();
  if (!done || !sound) {
    err << (done ? error_text(options.out, sound.error()) : error_text(options.file, done.error())) << '\n';
    return 1;
  }
  out << "copy        " << options.out << '\n'
      << "copied      " << grouped(done->messages) << " messages of " << grouped(done->chunks)
      << " whole chunks, " << grouped(done->attachments) << " attachments, " << grouped(done->metadata)
      << " metadata\n"
      << "finished    "
      << (done->was_finished ? "it was" : "it was not: what stood behind its last chunk is not known") << '\n'
      << "lost        " << loss_text(done->loss) << '\n';
  print_troubles(out, done->loss);
  return 0;
}

Verb add_recover_verb(CLI::App& app) {
  const auto options = std::make_shared<RecoverOptions>();
  options->progress = isatty(STDERR_FILENO) != 0;
  CLI::App* recover =
      app.add_subcommand("recover", "Make a sound copy of a recording that is damaged or was not finished");
  recover->add_option("file", options->file, "An MCAP file")->required();
  recover->add_option("--out", options->out, "The copy: a new file")->required();
  return {recover, [options] { return run_recover_command(*options, std::cout, std::cerr); }};
}

}  // namespace sightline
