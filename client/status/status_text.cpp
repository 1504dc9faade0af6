#include "client/status/status_text.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <vector>

#include "client/base/text_table.h"

namespace sightline {
namespace {

std::string levels_text(const v1::GetServerStatsResponse& stats) {
  std::string text;
  for (int level = 0; level < stats.sessions_at_level_size(); ++level)
    if (stats.sessions_at_level(level) > 0)
      text += formatted("%s%d: %s", text.empty() ? "" : ", ", level, grouped(stats.sessions_at_level(level)).c_str());
  return text.empty() ? "none" : text;
}

std::string limits_text(const v1::GetServerStatsResponse& stats) {
  std::string text;
  for (const v1::LimitCount& limit : stats.limits())
    text += (text.empty() ? "--" : ", --") + printable(limit.limit()) + " " + grouped(limit.count());
  return text.empty() ? "none" : text;
}

std::string kept_text(const v1::GetServerStatsResponse& stats) {
  return grouped(stats.kept_sessions()) + " wait for their client; since the start " +
         grouped(stats.resumed_sessions()) + " resumed, " + grouped(stats.expired_sessions()) + " not in time, " +
         grouped(stats.refused_resumes()) + " refused";
}

std::string blind_text(const v1::GetServerStatsResponse& stats) {
  std::string text = grouped(stats.blind_sessions()) + (stats.blind_sessions() == 1 ? " session" : " sessions") +
                     ", for 2 s or longer";
  if (stats.longest_blind_s() > 0) text += formatted("; the longest that plays, for %.1f s", stats.longest_blind_s());
  return text;
}

std::string access_text(const v1::AccessStats& access) {
  return grouped(access.refused_calls()) + " calls and " + grouped(access.failed_handshakes()) +
         " handshakes refused; changed files: " + grouped(access.files_taken_over()) + " taken over, " +
         grouped(access.files_refused()) + " refused";
}

std::string recording_text(const v1::GetServerStatsResponse& stats) {
  if (!stats.has_recording()) return "off";
  const v1::RecordingStats& recording = stats.recording();
  std::string text = grouped(recording.open_sessions()) + " sessions, " + bytes_text(recording.bytes()) + " written";
  if (recording.failing_sessions() > 0) text += ", " + grouped(recording.failing_sessions()) + " sessions have no file";
  if (recording.dropped_messages() > 0) text += ", " + grouped(recording.dropped_messages()) + " messages lost";
  return text;
}

std::string time_text(double us) {
  return us < 1000.0 ? formatted("%.0f us", us) : formatted("%.2f ms", us * 1e-3);
}

std::string percent_text(double share) {
  return formatted("%.1f %%", 100.0 * share);
}

std::string cameras_text(const CameraShares& cameras) {
  if (cameras.seconds <= 0.0) return "no time with targets";
  return "all targets seen in " + percent_text(cameras.tracking) + " of the time, not all in " +
         percent_text(cameras.partial) + ", none in " + percent_text(cameras.blind) + "; " +
         percent_text(cameras.shown) + " of the targets shown";
}

std::string shots_text(const CameraShares& cameras) {
  if (cameras.shot_seconds <= 0.0) return "no time with a shot";
  return formatted("worth %.2f, kept in ", cameras.worth) + percent_text(cameras.shot_kept) + " of the time, " +
         grouped(cameras.cuts) + (cameras.cuts == 1 ? " cut" : " cuts");
}

// TRACKING_STATUS_PARTIAL_VIEW -> "partial view"
std::string status_text(v1::TrackingStatus status) {
  constexpr size_t kPrefix = std::char_traits<char>::length("TRACKING_STATUS_");
  if (status == v1::TRACKING_STATUS_UNSPECIFIED) return "-";
  std::string text = v1::TrackingStatus_Name(status);
  if (text.size() <= kPrefix) return "-";
  text.erase(0, kPrefix);
  for (char& c : text) c = c == '_' ? ' ' : static_cast<char>(c - 'A' + 'a');
  return text;
}

struct SessionLine {
  const v1::SessionFigures* session;
  CameraShares cameras;
};

// A session that has had no targets so far comes last.
bool is_worse(const SessionLine& a, const SessionLine& b) {
  if (a.session->blind_s() != b.session->blind_s()) return a.session->blind_s() > b.session->blind_s();
  const auto shown = [](const SessionLine& line) { return line.cameras.target_seconds > 0 ? line.cameras.shown : 2.0; };
  return shown(a) < shown(b);
}

std::string or_dash(bool is_known, std::string text) {
  return is_known ? std::move(text) : "-";
}

}  // namespace

std::string duration_text(double seconds) {
  const auto s = static_cast<long>(seconds);
  if (s >= 86'400) return formatted("%ld d %ld h", s / 86'400, s % 86'400 / 3600);
  if (s >= 3600) return formatted("%ld h %ld min", s / 3600, s % 3600 / 60);
  if (s >= 60) return formatted("%ld min %ld s", s / 60, s % 60);
  return formatted("%ld s", s);
}

void print_state(std::ostream& out, const std::string& address, const v1::GetServerInfoResponse& info,
                 const v1::GetServerStatsResponse& stats) {
  out << "sightlined " << printable(info.version()) << " at " << address << ": "
      << (stats.ready() ? "ready" : "not ready") << ", up " << duration_text(stats.uptime_s()) << '\n'
      << "device        " << printable(info.sampler()) << ": " << printable(info.renderer(), 80) << '\n'
      << "sessions      " << grouped(stats.open_sessions()) << " open of " << grouped(info.max_sessions()) << ", "
      << grouped(stats.opened_sessions()) << " opened since the start\n"
      << "streams lost  " << kept_text(stats) << '\n'
      << "blind now     " << blind_text(stats) << '\n'
      << "quality       sessions by level: " << levels_text(stats) << '\n'
      << "connections   " << grouped(stats.open_connections()) << '\n'
      << "memory        " << bytes_text(stats.resident_bytes()) << ", of it geometry "
      << bytes_text(stats.geometry_bytes()) << '\n'
      << "limits hit    " << limits_text(stats) << '\n'
      << "credentials   " << access_text(stats.access()) << '\n'
      << "recording     " << recording_text(stats) << '\n';
}

void print_sessions(std::ostream& out, std::span<const v1::SessionFigures> sessions) {
  if (sessions.empty()) {
    out << "no session is open\n";
    return;
  }
  std::vector<SessionLine> lines;
  for (const v1::SessionFigures& session : sessions) lines.push_back({&session, camera_shares({}, session.camera())});
  std::stable_sort(lines.begin(), lines.end(), is_worse);
  Table table({{"session"},
               {"client"},
               {"label"},
               {"open for"},
               {"status"},
               {"blind s", true},
               {"shown", true},
               {"none seen", true},
               {"worth", true},
               {"shot kept", true},
               {"cuts", true},
               {"level", true}});
  for (const auto& [session, cameras] : lines)
    table.row({printable(session->session_id()), printable(session->client(), 30), printable(session->label(), 24),
               duration_text(session->age_s()), status_text(session->status()), formatted("%.1f", session->blind_s()),
               or_dash(cameras.target_seconds > 0, percent_text(cameras.shown)),
               or_dash(cameras.seconds > 0, percent_text(cameras.blind)),
               or_dash(cameras.shot_seconds > 0, formatted("%.2f", cameras.worth)),
               or_dash(cameras.shot_seconds > 0, percent_text(cameras.shot_kept)), grouped(cameras.cuts),
               grouped(session->quality_level())});
  table.print(out);
}

void print_window(std::ostream& out, const Window& window) {
  out << formatted("ticks/s       %.1f: %.1f answered, %.1f merged, %.1f refused\n", window.ticks_per_s,
                   window.steps_per_s, window.merged_per_s, window.refused_per_s)
      << formatted("steps         %.1f %% late, %.1f %% degraded\n", 100.0 * window.late_share,
                   100.0 * window.degraded_share)
      << "cameras       " << cameras_text(window.cameras) << '\n'
      << "shots         " << shots_text(window.cameras) << '\n'
      << "bytes/s       " << bytes_text(static_cast<uint64_t>(window.received_bytes_per_s)) << " received, "
      << bytes_text(static_cast<uint64_t>(window.sent_bytes_per_s)) << " sent\n"
      << formatted("CPUs          %.2f busy\n\n", window.cpus);
  Table table({{"time of"}, {"count", true}, {"mean", true}, {"p50", true}, {"p99", true}});
  for (const DurationRow& row : window.durations)
    table.row({row.name, grouped(row.count), time_text(row.mean_us), time_text(row.p50_us), time_text(row.p99_us)});
  table.print(out);
}

namespace {

nlohmann::ordered_json json_of(const CameraShares& cameras) {
  return {{"seconds", cameras.seconds}, {"tracking", cameras.tracking},   {"partial", cameras.partial},
          {"blind", cameras.blind},     {"shown", cameras.shown},         {"shot_seconds", cameras.shot_seconds},
          {"worth", cameras.worth},     {"shot_kept", cameras.shot_kept}, {"cuts", cameras.cuts}};
}

}  // namespace

nlohmann::ordered_json json_of(const Window& window) {
  nlohmann::ordered_json durations = nlohmann::ordered_json::object();
  for (const DurationRow& row : window.durations)
    durations[row.name.substr(row.name.find_first_not_of(' '))] = {
        {"count", row.count}, {"mean_us", row.mean_us}, {"p50_us", row.p50_us}, {"p99_us", row.p99_us}};
  return {{"seconds", window.seconds},
          {"ticks_per_s", window.ticks_per_s},
          {"steps_per_s", window.steps_per_s},
          {"merged_per_s", window.merged_per_s},
          {"refused_per_s", window.refused_per_s},
          {"late_share", window.late_share},
          {"degraded_share", window.degraded_share},
          {"received_bytes_per_s", window.received_bytes_per_s},
          {"sent_bytes_per_s", window.sent_bytes_per_s},
          {"cpus", window.cpus},
          {"cameras", json_of(window.cameras)},
          {"durations", std::move(durations)}};
}

}  // namespace sightline
