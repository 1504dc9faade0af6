#include "client/recordings/commands.h"

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <csignal>
#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "client/base/text_table.h"
#include "client/recordings/cut.h"
#include "client/recordings/summary.h"
#include "server/record/mcap_recover.h"
#include "server/record/mcap_verify.h"

namespace sightline {
namespace {

class WatchedSource final : public ByteSource {
 public:
  WatchedSource(std::shared_ptr<const ByteSource> source, ProgressBar& bar, std::string what)
      : source_(std::move(source)), bar_(bar), what_(std::move(what)) {}

  uint64_t size() const override { return source_->size(); }
  Status read_at(uint64_t offset, char* out, size_t count) const override {
    // Reading the tail does not say how far the rest is.
    if (offset + count < size()) bar_.show(what_, offset, size());
    return source_->read_at(offset, out, count);
  }

 private:
  const std::shared_ptr<const ByteSource> source_;
  ProgressBar& bar_;
  const std::string what_;
};

// Writes the new file `path` from `file`; a file that `write` did not complete is removed.
template <typename Write>
auto write_new_file(const std::string& path, const std::string& file, ProgressBar& bar, const char* what,
                    const Write& write)
    -> decltype(write(std::shared_ptr<const ByteSource>(), std::declval<ByteSink&>())) {
  const auto source = open_watched(file, bar, what);
  if (!source) return tl::unexpected(source.error());
  const auto sink = create_file_sink(path);
  if (!sink) return tl::unexpected(sink.error());
  auto done = write(*source, **sink);
  std::error_code ignored;
  if (!done) std::filesystem::remove(path, ignored);
  return done;
}

// Why there is no copy: an error of the file that is read, or of the one that is written.
std::string copy_error(const std::string& file, const std::string& copy, const Error& error) {
  return error_text(error.field == copy ? copy : file, error);
}

Result<RecordingSummary> summary_of(const std::string& path, McapLimits limits, ProgressBar& bar) {
  auto source = open_watched(path, bar, "reading");
  if (!source) return tl::unexpected(std::move(source.error()));
  auto summary = summarise_recording(std::move(*source), path, limits);
  bar.clear();
  return summary;
}

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

bool is_loss(const McapLoss& loss) {
  return loss.chunks + loss.messages + loss.bytes > 0;
}

// Names come from files: what is no text is replaced, not refused.
std::string line_of(const nlohmann::ordered_json& json) {
  return json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + '\n';
}

nlohmann::ordered_json json_of(const std::string& copy, const McapRecovery& done) {
  return {{"copy", copy},
          {"messages", done.messages},
          {"chunks", done.chunks},
          {"attachments", done.attachments},
          {"metadata", done.metadata},
          {"was_finished", done.was_finished},
          {"lost", json_of(done.loss)}};
}

nlohmann::ordered_json json_of(const std::string& cut, const RecordingCut& done) {
  return {{"cut", cut},
          {"messages", done.messages},
          {"attachments", done.attachments},
          {"snapshot_ticks", done.snapshot_ticks},
          {"lead_messages", done.lead_messages},
          {"lead_s", done.lead_s},
          {"lost", json_of(done.loss)}};
}

void print_recovery(std::ostream& out, const std::string& copy, const McapRecovery& done) {
  out << "copy        " << copy << '\n'
      << "copied      " << grouped(done.messages) << " messages of " << grouped(done.chunks) << " whole chunks, "
      << grouped(done.attachments) << " attachments, " << grouped(done.metadata) << " metadata\n"
      << "finished    " << (done.was_finished ? "yes" : "no: data after the last chunk, if any, is lost") << '\n'
      << "lost        " << loss_text(done.loss) << '\n';
  print_troubles(out, done.loss);
}

void print_cut(std::ostream& out, const std::string& cut, const RecordingCut& done) {
  out << "cut         " << cut << '\n'
      << "copied      " << grouped(done.messages) << " messages, " << grouped(done.attachments) << " attachments\n"
      << "begins      "
      << (done.snapshot_ticks == 0 ? std::string("where the recording begins")
                                   : "after " + grouped(done.snapshot_ticks) + " ticks, given as one snapshot tick")
      << '\n';
  if (done.lead_messages > 0)
    out << formatted("lead        %.3f s before the range, so that a replay has the camera's state to the bit\n",
                     done.lead_s);
}

// Reads the copy as any other file, as far as the source was read.
Status check_copy(const RecoverOptions& options, ProgressBar& bar) {
  const std::string& path = options.out;
  std::error_code unknown;
  McapLimits limits = options.read.limits();
  limits.max_unpacked_bytes = limits.unpacked_within(std::filesystem::file_size(options.file, unknown));
  const auto source = open_watched(path, bar, "verifying");
  if (!source) return tl::unexpected(source.error());
  const auto verdict = verify_mcap(**source, limits);
  if (!verdict) return tl::unexpected(verdict.error());
  if (verdict->sound()) return {};
  return fail(ErrorCode::kInternal, path, "the copy is not sound");
}

// Adds a command whose options come from `flags`.
template <typename Options, typename Flags>
Verb add_verb(CLI::App& app, const char* name, const char* help,
              int (*run)(const Options&, std::ostream&, std::ostream&), const Flags& flags) {
  const auto options = std::make_shared<Options>();
  options->progress = isatty(STDERR_FILENO) != 0;
  CLI::App* command = app.add_subcommand(name, help);
  flags(*command, *options);
  command
      ->add_option(
          "--max-unpacked-gib", options->read.max_unpacked_gib,
          "Most that the chunks of a file may unpack to, in GiB. Default: 512 times the file's size, and 0.25 GiB")
      ->check(CLI::PositiveNumber);
  return {command, [options, run] { return run(*options, std::cout, std::cerr); }};
}

void add_range(CLI::App& command, double& start_s, double& end_s) {
  command.add_option("--start", start_s, "Start, seconds after the first message (default: 0)")
      ->check(CLI::NonNegativeNumber);
  command.add_option("--end", end_s, "End, seconds after the first message (default: the end of the file)")
      ->check(CLI::NonNegativeNumber);
}

int run_dump_into_pipe(const DumpOptions& options, std::ostream& out, std::ostream& err) {
  // A reader that has enough closes the pipe: then writing fails, and nothing else.
  std::signal(SIGPIPE, SIG_IGN);
  return run_dump_command(options, out, err);
}

}  // namespace

Result<std::shared_ptr<const ByteSource>> open_watched(const std::string& path, ProgressBar& bar,
                                                       const std::string& what) {
  auto source = open_file_source(path);
  if (!source) return tl::unexpected(std::move(source.error()));
  return std::make_shared<WatchedSource>(std::shared_ptr<const ByteSource>(std::move(*source)), bar, what);
}

McapLimits ReadLimit::limits() const {
  McapLimits limits;
  // Beyond what a number of bytes holds, there is no limit.
  if (max_unpacked_gib > 0)
    limits.max_unpacked_bytes = static_cast<uint64_t>(std::min(max_unpacked_gib, 1e9) * (uint64_t{1} << 30));
  return limits;
}

int run_info_command(const InfoOptions& options, std::ostream& out, std::ostream& err) {
  ProgressBar bar(err, options.progress);
  int status = 0;
  bool first = true;
  for (const std::string& path : options.files) {
    const auto summary = summary_of(path, options.read.limits(), bar);
    if (!summary) {
      bar.clear();
      err << error_text(path, summary.error()) << '\n';
      status = 1;
      continue;
    }
    if (options.json) {
      out << line_of(json_of(*summary));
      continue;
    }
    if (!std::exchange(first, false)) out << '\n';
    print_summary(out, *summary);
  }
  return status;
}

int run_recover_command(const RecoverOptions& options, std::ostream& out, std::ostream& err) {
  ProgressBar bar(err, options.progress);
  const auto done = write_new_file(options.out, options.file, bar, "recovering",
                                   [&](const auto& source, ByteSink& sink) -> Result<McapRecovery> {
                                     return recover_mcap(*source, sink, options.read.limits(), {}, note_of);
                                   });
  const Status sound = done ? check_copy(options, bar) : Status{};
  bar.clear();
  if (!done || !sound) {
    err << (done ? error_text(options.out, sound.error()) : copy_error(options.file, options.out, done.error()))
        << '\n';
    return 1;
  }
  if (options.json)
    out << line_of(json_of(options.out, *done));
  else
    print_recovery(out, options.out, *done);
  return is_loss(done->loss) ? 1 : 0;
}

int run_cut_command(const CutOptions& options, std::ostream& out, std::ostream& err) {
  if (!(options.start_s < options.end_s)) {
    err << "--end must be after --start\n";
    return 2;
  }
  ProgressBar bar(err, options.progress);
  const auto done = write_new_file(
      options.out, options.file, bar, "cutting",
      [&](const std::shared_ptr<const ByteSource>& source, ByteSink& sink) -> Result<RecordingCut> {
        const auto recording = Recording::open(source, options.file, options.read.limits());
        if (!recording) return tl::unexpected(recording.error());
        return cut_recording(*recording, {options.start_s, options.end_s}, sink);
      });
  bar.clear();
  if (!done) {
    err << copy_error(options.file, options.out, done.error()) << '\n';
    return 1;
  }
  if (options.json)
    out << line_of(json_of(options.out, *done));
  else
    print_cut(out, options.out, *done);
  const bool lost = done->loss.chunks + done->loss.messages > 0;
  if (!lost) return 0;
  err << options.file << ": lost " << loss_text(done->loss) << '\n';
  print_troubles(err, done->loss);
  return 1;
}

std::vector<Verb> add_recording_verbs(CLI::App& app) {
  const char* json_help = "One JSON object a line for each file";
  return {
      add_verb(app, "info", "List what recordings contain", run_info_command,
               [&](CLI::App& command, InfoOptions& options) {
                 command.add_option("files", options.files, "MCAP files")->required();
                 command.add_flag("--json", options.json, json_help);
               }),
      add_verb(app, "verify", "Check whether recordings are whole and consistent", run_verify_command,
               [&](CLI::App& command, VerifyOptions& options) {
                 command.add_option("files", options.files, "MCAP files")->required();
                 command.add_flag("--json", options.json, json_help);
               }),
      add_verb(app, "recover", "Make a sound copy of a recording that is damaged or was not finished",
               run_recover_command,
               [](CLI::App& command, RecoverOptions& options) {
                 command.add_option("file", options.file, "An MCAP file")->required();
                 command.add_option("--out", options.out, "The copy: a new file")->required();
                 command.add_flag("--json", options.json, "One JSON object instead of text");
               }),
      add_verb(
          app, "dump", "Print the messages of a recording, or of any MCAP file, as lines of JSON", run_dump_into_pipe,
          [](CLI::App& command, DumpOptions& options) {
            command.add_option("file", options.file, "An MCAP file")->required();
            command.add_option("--topic", options.topics, "Only this topic; may be repeated")->allow_extra_args(false);
            add_range(command, options.start_s, options.end_s);
            command.add_option("--limit", options.limit, "Print at most this many lines");
            command.add_option("--out", options.out, "Write to this new file instead of the standard output");
          }),
      add_verb(app, "cut", "Copy a part of a recording into a recording that stands alone", run_cut_command,
               [](CLI::App& command, CutOptions& options) {
                 command.add_option("file", options.file, "A recording")->required();
                 command.add_option("--out", options.out, "The cut: a new file")->required();
                 add_range(command, options.start_s, options.end_s);
                 command.add_flag("--json", options.json, "One JSON object instead of text");
               }),
  };
}

}  // namespace sightline
