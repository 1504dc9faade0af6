// `sightline verify`: whether recordings are whole and consistent.
#include <nlohmann/json.hpp>
#include <optional>

#include "client/base/text_table.h"
#include "client/recordings/check.h"
#include "client/recordings/commands.h"
#include "client/recordings/summary.h"
#include "server/record/mcap_verify.h"

namespace sightline {
namespace {

struct FileVerdict {
  McapVerdict container;
  std::optional<SessionVerdict> session;  // none: no session of ours
  std::string not_a_session;
  bool recovered = false;

  bool sound() const { return container.sound() && (!session || session->sound() || recovered); }
};

Result<FileVerdict> verdict_of(const std::string& path, McapLimits limits, ProgressBar& bar) {
  auto source = open_watched(path, bar, "verifying");
  if (!source) return tl::unexpected(std::move(source.error()));
  auto container = verify_mcap(**source, limits);
  if (!container) return tl::unexpected(std::move(container.error()));
  FileVerdict verdict;
  verdict.container = std::move(*container);
  const auto recording = Recording::open(*source, path, limits);
  if (recording) {
    verdict.session = check_session(*recording);
    for (const mcap::MetadataIndex& metadata : recording->container().metadata)
      verdict.recovered |= metadata.name == kRecoveredMetadata;
  } else {
    verdict.not_a_session = to_string(recording.error());
  }
  bar.clear();
  return verdict;
}

void print_session_troubles(std::ostream& out, const SessionVerdict& session) {
  for (const SessionTrouble& trouble : session.first_troubles)
    out << formatted("  at %.3f s: ", trouble.at_s) << printable(trouble.text, 300) << '\n';
  if (session.troubles > session.first_troubles.size())
    out << "  ... and " << grouped(session.troubles - session.first_troubles.size()) << " more\n";
}

void print_topics(std::ostream& out, const McapVerdict& verdict) {
  if (verdict.topics.empty()) return;
  out << "\ntopics (" << verdict.topics.size() << ")\n";
  Table table({{"topic"}, {"messages", true}, {"missing", true}, {"out of order", true}, {"longest silence", true}});
  for (const auto& [topic, found] : verdict.topics)
    table.row({printable(topic, 100), grouped(found.messages), grouped(found.missing), grouped(found.out_of_order),
               formatted("%.3f s", static_cast<double>(found.longest_silence_ns) * 1e-9)});
  table.print(out);
}

std::string sound_text(const McapLoss& disagreements) {
  return disagreements.none() ? "agrees with itself" : grouped(disagreements.troubles) + " disagreements";
}

void print_verdict(std::ostream& out, const std::string& path, const FileVerdict& verdict) {
  const McapVerdict& container = verdict.container;
  out << "file        " << path << '\n'
      << "verdict     " << (verdict.sound() ? "sound" : "not sound") << '\n'
      << "finished    " << (container.finished ? "yes" : "no: its end is missing, as a killed server leaves it") << '\n'
      << "chunks      " << grouped(container.chunks);
  if (container.chunks_without_crc > 0) out << ", " << grouped(container.chunks_without_crc) << " without a CRC";
  out << '\n';
  print_absent(out, container.absent);
  out << "lost        " << loss_text(container.loss) << '\n';
  print_troubles(out, container.loss);
  out << "container   " << sound_text(container.disagreements) << '\n';
  print_troubles(out, container.disagreements);
  if (!verdict.session) {
    out << "session     none: " << printable(verdict.not_a_session, 200) << '\n';
  } else {
    const SessionVerdict& session = *verdict.session;
    out << "session     " << grouped(session.ticks) << " ticks applied, " << grouped(session.replies) << " replies, "
        << grouped(session.rejections) << " refused; missing by numbers " << grouped(session.missing) << ", by gaps "
        << grouped(session.gap_messages) << '\n';
    if (!session.sound())
      out << (verdict.recovered ? "lost before it was recovered, so that the session does not go together:\n"
                                : "the session does not go together:\n");
    print_session_troubles(out, session);
  }
  print_topics(out, container);
}

nlohmann::ordered_json json_of(const std::string& path, const FileVerdict& verdict) {
  const McapVerdict& container = verdict.container;
  nlohmann::ordered_json out = {{"file", path},
                                {"sound", verdict.sound()},
                                {"finished", container.finished},
                                {"recovered", verdict.recovered},
                                {"chunks", container.chunks},
                                {"absent", container.absent},
                                {"lost", json_of(container.loss)},
                                {"disagreements", json_of(container.disagreements)}};
  out["session"] = nullptr;
  if (verdict.session) {
    const SessionVerdict& s = *verdict.session;
    nlohmann::ordered_json first = nlohmann::ordered_json::array();
    for (const SessionTrouble& trouble : s.first_troubles)
      first.push_back({{"at_s", trouble.at_s}, {"text", trouble.text}});
    out["session"] = {{"ticks", s.ticks},           {"replies", s.replies},
                      {"rejections", s.rejections}, {"gap_messages", s.gap_messages},
                      {"missing", s.missing},       {"undecodable", s.undecodable},
                      {"troubles", s.troubles},     {"first", std::move(first)}};
  }
  out["topics"] = nlohmann::ordered_json::array();
  for (const auto& [topic, found] : container.topics)
    out["topics"].push_back({{"topic", topic},
                             {"messages", found.messages},
                             {"missing", found.missing},
                             {"out_of_order", found.out_of_order},
                             {"longest_silence_s", static_cast<double>(found.longest_silence_ns) * 1e-9}});
  return out;
}

}  // namespace

int run_verify_command(const VerifyOptions& options, std::ostream& out, std::ostream& err) {
  ProgressBar bar(err, options.progress);
  int status = 0;
  bool first = true;
  for (const std::string& path : options.files) {
    const auto verdict = verdict_of(path, options.read.limits(), bar);
    if (!verdict) {
      bar.clear();
      err << error_text(path, verdict.error()) << '\n';
      status = 1;
      continue;
    }
    if (!verdict->sound()) status = 1;
    if (options.json) {
      out << json_of(path, *verdict).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) << '\n';
      continue;
    }
    if (!std::exchange(first, false)) out << '\n';
    print_verdict(out, path, *verdict);
  }
  return status;
}

}  // namespace sightline
