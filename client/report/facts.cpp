#include "client/report/facts.h"

#include <filesystem>

#include "client/base/text_table.h"
#include "server/wire/short_name.h"

namespace sightline {
namespace {

std::string part_text(const v1::RecordingInfo& info) {
  std::string text = std::to_string(info.part());
  if (info.snapshot_ticks() > 0)
    text.append(", begins after ").append(std::to_string(info.snapshot_ticks())).append(" ticks");
  return text;
}

std::string convention_text(const v1::Convention& convention) {
  return convention.preset() == v1::Convention::PRESET_UNSPECIFIED
             ? "GLTF"
             : short_name(convention.preset());
}

}  // namespace

std::vector<std::pair<std::string, std::string>> recording_facts(const Recording& recording,
                                                                 const RecordingDigest& digest) {
  const v1::RecordingInfo& info = recording.info();
  const v1::SessionOpened& opened = recording.opened();
  const DigestFigures& figures = digest.figures;
  std::vector<std::pair<std::string, std::string>> facts = {
      {"start", utc_text(info.start_time_ns() != 0 ? info.start_time_ns() : recording.start_ns())},
      {"duration", formatted("%.2f s", recording.duration_s())},
      {"sampler", info.sampler()},
      {"ticks", std::to_string(figures.ticks)},
      {"replies", std::to_string(figures.replies)},
      {"refused", std::to_string(figures.rejections)},
      {"faults", std::to_string(figures.faults)},
      {"missing", std::to_string(figures.missing)},
      {"session", info.session_id()},
      {"label", info.label()},
      {"recording", std::filesystem::path(recording.name()).filename().string()},
      {"part", part_text(info)},
      {"seed", std::to_string(recording.open_session().seed())},
      {"server", info.server_version()},
      {"build", info.build()},
      {"convention", convention_text(recording.open_session().convention())},
      {"instances", std::to_string(opened.instance_count())},
      {"triangles", std::to_string(opened.triangle_count())},
      {"mirror", formatted("%016llx", static_cast<unsigned long long>(opened.mirror_hash()))}};
  for (const std::string& warning : opened.warnings()) facts.emplace_back("warning", warning);
  std::erase_if(facts, [](const auto& fact) { return fact.second.empty(); });
  return facts;
}

std::vector<std::string> recording_notices(const Recording& recording, const RecordingDigest& digest) {
  std::vector<std::string> notices;
  const auto count = [](uint64_t n) { return std::to_string(n); };
  const size_t replies = digest.kept.size();
  if (digest.frames < replies) {
    const std::string changes = "change of status, reason or flags or a cut";
    notices.push_back(count(digest.frames) + " of " + count(replies) + " replies are frames here: " +
                      (digest.kept_changes < digest.changes ? count(digest.kept_changes) + " of the " +
                                                                  count(digest.changes) + " with a " + changes
                                                            : "every one with a " + changes) +
                      ", and an even share of the others; the figures are of all.");
  }
  if (!recording.container().finished)
    notices.push_back("The file has no end: its writer was stopped, and up to a second may be missing.");
  if (!recording.container().loss.none() || !digest.read.loss.none())
    notices.push_back(
        "The file is damaged: " + count(recording.container().loss.troubles + digest.read.loss.troubles) +
        " places cannot be read.");
  if (digest.read.undecodable > 0)
    notices.push_back(count(digest.read.undecodable) + " messages cannot be decoded and are left out.");
  if (recording.info().snapshot_ticks() > 0)
    notices.push_back("The file begins in the middle of its session, after " +
                      count(recording.info().snapshot_ticks()) + " ticks.");
  if (digest.figures.missing > 0)
    notices.push_back(count(digest.figures.missing) +
                      " messages were not recorded: after such a gap things may not stand where they stood.");
  if (digest.left_out_marks > 0)
    notices.push_back(count(digest.left_out_marks) + " more events are not listed.");
  return notices;
}

}  // namespace sightline
