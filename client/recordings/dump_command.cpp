#include "client/recordings/dump_command.h"

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "client/recordings/message_json.h"
#include "client/recordings/recording.h"
#include "client/recordings/summary.h"
#include "client/base/text_table.h"
#include "client/recordings/watched_source.h"

namespace sightline {
namespace {

// Any text as a JSON string; bytes that are none are replaced.
std::string quoted(const std::string& text) {
  return nlohmann::json(text).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

// What is asked for and not there is more likely a slip than a wish for nothing.
Status check_topics(const McapInfo& info, const std::vector<std::string>& topics) {
  for (const std::string& topic : topics) {
    const auto is_it = [&](const auto& channel) { return channel.second.topic == topic; };
    if (std::any_of(info.channels.begin(), info.channels.end(), is_it)) continue;
    std::string known;
    for (const auto& [_, channel] : info.channels)
      known.append(known.empty() ? "" : ", ").append(channel.topic);
    return fail(ErrorCode::kNotFound, "--topic",
                "the file has no topic " + printable(topic, 100) + "; it has " + printable(known, 1000));
  }
  return {};
}

struct Dumped {
  uint64_t lines = 0, undecodable = 0;
  std::string first_error;
  McapLoss loss;
};

class Dumper {
 public:
  Dumper(std::ostream& out, uint64_t limit) : out_(out), limit_(limit) {}

  // False: no more is wanted.
  bool take(const McapMessage& m) {
    if (done_.lines >= limit_) return false;
    const auto text = json_.text_of(m);
    if (!text) {
      ++done_.undecodable;
      if (done_.first_error.empty()) done_.first_error = to_string(text.error());
    }
    out_ << "{\"topic\":" << quoted(m.channel.topic) << ",\"sequence\":" << m.message.sequence
         << ",\"log_time_ns\":" << m.message.log_time_ns
         << ",\"publish_time_ns\":" << m.message.publish_time_ns;
    if (text)
      out_ << ",\"message\":" << **text << "}\n";
    else
      out_ << ",\"error\":" << quoted(to_string(text.error())) << "}\n";
    ++done_.lines;
    return out_.good() && done_.lines < limit_;
  }
  Dumped take_done() { return std::move(done_); }

 private:
  std::ostream& out_;
  const uint64_t limit_;
  MessageJson json_;
  Dumped done_;
};

Result<Dumped> dump(const DumpOptions& options, std::ostream& out, ProgressBar& bar) {
  const auto source = open_watched(options.file, bar, "dumping");
  if (!source) return tl::unexpected(source.error());
  const auto reader = McapReader::open(**source, {});
  if (!reader) return tl::unexpected(reader.error());
  if (Status ok = check_topics(reader->info(), options.topics); !ok) return tl::unexpected(ok.error());
  const uint64_t start_ns = reader->info().statistics.start_time_ns;
  const McapQuery query{.start_ns = log_time_after(start_ns, options.start_s),
                        .end_ns = log_time_after(start_ns, options.end_s),
                        .topics = options.topics};
  Dumper dumper(out, options.limit);
  const McapReadReport report = reader->read(query, [&](const McapMessage& m) { return dumper.take(m); });
  Dumped done = dumper.take_done();
  done.loss = report.loss;
  if (reader->info().loss.troubles > 0) done.loss = reader->info().loss;
  return done;
}

int tell(const std::string& file, const Result<Dumped>& done, std::ostream& err) {
  if (!done) {
    err << error_text(file, done.error()) << '\n';
    return 1;
  }
  // An end that is missing is told, and no fault of what is there.
  const bool lost = done->loss.chunks + done->loss.messages > 0;
  if (lost) err << file << ": lost " << loss_text(done->loss) << '\n';
  if (lost) print_troubles(err, done->loss);
  if (done->undecodable > 0)
    err << file << ": " << grouped(done->undecodable)
        << " messages cannot be decoded, the first: " << printable(done->first_error, 300) << '\n';
  return lost || done->undecodable > 0 ? 1 : 0;
}

}  // namespace

int run_dump_command(const DumpOptions& options, std::ostream& out, std::ostream& err) {
  if (options.out.empty()) {
    ProgressBar none(err, false);
    const auto done = dump(options, out, none);
    out.flush();
    if (!out.good()) return 0;  // whoever read has enough
    return tell(options.file, done, err);
  }
  if (std::filesystem::exists(options.out)) {
    err << options.out << ": exists already\n";
    return 1;
  }
  std::ofstream file(options.out, std::ios::binary);
  ProgressBar bar(err, options.progress);
  const auto done = dump(options, file, bar);
  bar.clear();
  file.flush();
  if (!file.good()) {
    err << options.out << ": cannot be written\n";
    return 1;
  }
  return tell(options.file, done, err);
}

Verb add_dump_verb(CLI::App& app) {
  const auto options = std::make_shared<DumpOptions>();
  options->progress = isatty(STDERR_FILENO) != 0;
  CLI::App* dump =
      app.add_subcommand("dump", "Print the messages of a recording, or of any MCAP file, as lines of JSON");
  dump->add_option("file", options->file, "An MCAP file")->required();
  dump->add_option("--topic", options->topics, "Only this topic; may be repeated")->allow_extra_args(false);
  dump->add_option("--start", options->start_s, "From so many seconds after the first message on")
      ->check(CLI::NonNegativeNumber);
  dump->add_option("--end", options->end_s, "Up to so many seconds after the first message")
      ->check(CLI::NonNegativeNumber);
  dump->add_option("--limit", options->limit, "So many lines at most");
  dump->add_option("--out", options->out, "Into a new file");
  return {dump, [options] {
            // A reader that has enough closes the pipe: then writing fails, and nothing else.
            std::signal(SIGPIPE, SIG_IGN);
            return run_dump_command(*options, std::cout, std::cerr);
          }};
}

}  // namespace sightline
