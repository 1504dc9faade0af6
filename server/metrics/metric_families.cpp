#include "server/metrics/metric_families.h"

#include <prometheus/metric_family.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>

#include "server/base/process_figures.h"
#include "server/record/recorder.h"
#include "server/service/server_info.h"

namespace sightline {
namespace {

using prometheus::ClientMetric;
using prometheus::MetricFamily;
using prometheus::MetricType;
using Families = std::vector<MetricFamily>;
using Labels = std::vector<ClientMetric::Label>;

// The names of gRPC's status codes, by code.
constexpr std::array<const char*, 17> kStatusNames{
    "OK",        "CANCELLED",      "UNKNOWN",           "INVALID_ARGUMENT",   "DEADLINE_EXCEEDED",
    "NOT_FOUND", "ALREADY_EXISTS", "PERMISSION_DENIED", "RESOURCE_EXHAUSTED", "FAILED_PRECONDITION",
    "ABORTED",   "OUT_OF_RANGE",   "UNIMPLEMENTED",     "INTERNAL",           "UNAVAILABLE",
    "DATA_LOSS", "UNAUTHENTICATED"};

// Histograms have a bucket for each octave from 2^4 us (16 us) to 2^21 us (2.1 s), which a step or a tick can take.
constexpr size_t kFirstOctave = 4, kLastOctave = 21;

MetricFamily& family(Families& families, std::string name, std::string help, MetricType type) {
  return families.emplace_back(MetricFamily{std::move(name), std::move(help), type, {}});
}

void gauge(MetricFamily& family, double value, Labels labels = {}) {
  ClientMetric& metric = family.metric.emplace_back();
  metric.label = std::move(labels);
  metric.gauge.value = value;
}

void counter(MetricFamily& family, double value, Labels labels = {}) {
  ClientMetric& metric = family.metric.emplace_back();
  metric.label = std::move(labels);
  metric.counter.value = value;
}

void histogram(MetricFamily& family, const DurationCounts& counts, Labels labels = {}) {
  ClientMetric& metric = family.metric.emplace_back();
  metric.label = std::move(labels);
  const auto octaves = counts.by_octave();
  uint64_t below = 0;
  for (size_t i = 0; i < octaves.size(); ++i) {
    below += octaves[i];
    if (i >= kFirstOctave && i <= kLastOctave)
      metric.histogram.bucket.push_back({below, std::ldexp(1e-6, static_cast<int>(i))});
  }
  metric.histogram.bucket.push_back({below, INFINITY});
  metric.histogram.sample_count = below;
  metric.histogram.sample_sum = counts.sum_s();
}

template <typename Number>
void add_gauge(Families& families, std::string name, std::string help, Number value) {
  gauge(family(families, std::move(name), std::move(help), MetricType::Gauge), static_cast<double>(value));
}

template <typename Number>
void add_counter(Families& families, std::string name, std::string help, Number value) {
  counter(family(families, std::move(name), std::move(help), MetricType::Counter), static_cast<double>(value));
}

void add_histogram(Families& families, std::string name, std::string help, const DurationCounts& counts) {
  histogram(family(families, std::move(name), std::move(help), MetricType::Histogram), counts);
}

// --- the families, by theme
// ---------------------------------------------------------------------------------------

void add_daemon(const MetricSource& source, Families& families) {
  gauge(family(families, "sightline_build_info", "Version and build of the daemon; always 1.", MetricType::Gauge), 1.0,
        {{"version", kVersion}, {"build", kBuild}});
  gauge(family(families, "sightline_device_info", "What takes the depth maps; always 1.", MetricType::Gauge), 1.0,
        {{"sampler", source.parts.sampler.kind()}, {"renderer", source.parts.sampler.renderer()}});
  add_counter(families, "sightline_context_losses_total", "Times that the graphics context was lost and built again.",
              source.context_losses());
  add_gauge(families, "sightline_ready", "1 while the daemon is ready for sessions, otherwise 0.",
            source.state.ready());
  add_gauge(families, "sightline_hanging_threads", "Kinds of threads that have not answered for --stall-s.",
            source.state.hanging().size());
  add_gauge(families, "sightline_step_threads", "Threads that compute steps.", source.parts.scheduler.threads());
}

void add_sessions(const MetricSource& source, Families& families) {
  const StepStats& stats = source.parts.stats;
  add_gauge(families, "sightline_sessions_open", "Control calls that are open now, opened sessions or not.",
            source.parts.streams.size());
  add_gauge(families, "sightline_sessions_max", "Control calls that may be open at the same time.",
            source.parts.streams.max_streams());
  add_counter(families, "sightline_sessions_opened_total", "Sessions opened.", stats.opened.load());
  add_counter(families, "sightline_session_opens_refused_total",
              "Sessions that could not be opened because the request was refused.", stats.open_refused.load());
  add_gauge(families, "sightline_sessions_kept", "Sessions whose stream broke, and which wait for another one.",
            stats.kept.load());
  add_counter(families, "sightline_sessions_resumed_total", "Times that a session went on in another stream.",
              stats.resumed.load());
  add_counter(families, "sightline_sessions_expired_total", "Kept sessions that no stream resumed in time.",
              stats.resume_expired.load());
  add_counter(families, "sightline_session_resumes_refused_total",
              "Times that a session to resume was not kept, or belonged to another client.",
              stats.resume_refused.load());
  MetricFamily& closed = family(families, "sightline_sessions_closed_total", "Sessions that ended, by gRPC status.",
                                MetricType::Counter);
  for (size_t code = 0; code < kStatusNames.size(); ++code)
    counter(closed, static_cast<double>(stats.closed[code]), {{"code", kStatusNames[code]}});
  MetricFamily& levels = family(families, "sightline_sessions_at_quality_level",
                                "Open sessions by the quality level of their next step; 0 leaves nothing out.",
                                MetricType::Gauge);
  for (size_t level = 0; level < kQualityLevels; ++level)
    gauge(levels, static_cast<double>(stats.sessions_at_level[level]), {{"level", std::to_string(level)}});
}

constexpr std::array<const char*, kTrackingStatuses> kTrackingStatusNames{
    "tracking", "partial_view", "seeking", "blocked", "waiting", "lost", "holding"};

void add_cameras(const SessionTable& sessions, int64_t now_ns, Families& families) {
  const CameraSums sums = sessions.sums();
  const SessionTable::Now now = sessions.now(now_ns);
  MetricFamily& by_status = family(families, "sightline_sessions_by_status",
                                   "Open sessions that have had a step, by the tracking status of the last one.",
                                   MetricType::Gauge);
  for (size_t i = 0; i < kTrackingStatuses; ++i)
    gauge(by_status, static_cast<double>(now.by_status[i]), {{"status", kTrackingStatusNames[i]}});
  add_gauge(families, "sightline_sessions_blind",
            "Open sessions whose camera has seen nothing of its targets for 2 s of the game or longer.", now.blind);
  add_gauge(
      families, "sightline_longest_blind_seconds",
      "Longest time of the game for which the camera of one open session has seen nothing of its targets. Sessions "
      "whose game stands still do not count.",
      now.longest_blind_s);
  MetricFamily& seconds = family(families, "sightline_camera_seconds_total",
                                 "Time of the game by tracking status, over all cameras.", MetricType::Counter);
  for (size_t i = 0; i < kTrackingStatuses; ++i)
    counter(seconds, sums.status_s[i], {{"status", kTrackingStatusNames[i]}});
  add_counter(families, "sightline_target_seconds_total", "Time of the game, times the number of targets to show.",
              sums.target_s);
  add_counter(families, "sightline_target_shown_seconds_total",
              "Time of the game, times the share of each target that the picture shows, neither hidden nor cut off.",
              sums.shown_s);
  add_counter(families, "sightline_shot_seconds_total", "Time of the game in which a shot was wanted of some target.",
              sums.shot_s);
  add_counter(families, "sightline_shot_kept_seconds_total",
              "Time of the game in which side, height and size of the shot were within their free bands.",
              sums.shot_kept_s);
  add_counter(families, "sightline_shot_worth_seconds_total",
              "Time of the game with a shot, times the worth of the pictures, 0 to 1.", sums.worth_s);
  add_counter(families, "sightline_cuts_total", "Cuts that the server chose.", sums.cuts);
}

void add_ticks(const MetricSource& source, Families& families) {
  const StepStats& stats = source.parts.stats;
  add_counter(families, "sightline_ticks_received_total", "Ticks that the sessions worked through.",
              stats.ticks.load());
  MetricFamily& ticks = family(families, "sightline_ticks_total",
                               "Ticks by outcome: answered by their own step, merged into a later one, or refused.",
                               MetricType::Counter);
  counter(ticks, static_cast<double>(stats.steps), {{"outcome", "answered"}});
  counter(ticks, static_cast<double>(stats.merged), {{"outcome", "merged"}});
  counter(ticks, static_cast<double>(stats.refused), {{"outcome", "refused"}});
  add_histogram(families, "sightline_tick_age_seconds",
                "Time from the arrival of the newest tick of a step to its reply.", stats.tick_age);
  add_histogram(families, "sightline_tick_queue_seconds", "Time that a tick waits for the start of its step.",
                stats.queue);
}

void add_steps(const MetricSource& source, Families& families) {
  const StepStats& stats = source.parts.stats;
  MetricFamily& steps = family(families, "sightline_steps_total", "Steps computed, by quality level.",
                               MetricType::Counter);
  for (size_t level = 0; level < kQualityLevels; ++level)
    counter(steps, static_cast<double>(stats.steps_at_level[level]), {{"level", std::to_string(level)}});
  add_counter(families, "sightline_steps_degraded_total", "Steps that left something out for want of time.",
              stats.degraded.load());
  add_counter(families, "sightline_steps_late_total", "Steps that ended later than one tick interval after their tick.",
              stats.late.load());
  add_histogram(families, "sightline_step_seconds", "Time to compute a step: the sum of its stages.", stats.step);
  MetricFamily& stages = family(families, "sightline_step_stage_seconds", "Time of each stage of a step.",
                                MetricType::Histogram);
  for (size_t i = 0; i < kStageNames.size(); ++i) histogram(stages, stats.stages[i], {{"stage", kStageNames[i]}});
}

void add_limits(const MetricSource& source, const GateCounts& gate, Families& families) {
  MetricFamily& limits = family(families, "sightline_limit_hits_total",
                                "How often a limit refused or ended something, by the flag that sets it.",
                                MetricType::Counter);
  for (const auto& [name, count] : limit_hits(source.parts, gate))
    counter(limits, static_cast<double>(count), {{"limit", std::string(name)}});
}

void add_connections(const GateCounts& gate, Families& families) {
  add_gauge(families, "sightline_connections_open", "Connections that are open now.", gate.open);
  add_counter(families, "sightline_connections_accepted_total", "Connections accepted.", gate.accepted);
  add_counter(families, "sightline_connections_refused_total", "Connections refused because no place was left.",
              gate.refused);
  add_counter(families, "sightline_connections_cut_total", "Connections cut for what the client sent, or for silence.",
              gate.cut);
  add_counter(families, "sightline_received_bytes_total", "Bytes from clients, with the framing of HTTP/2.",
              gate.received_bytes);
  add_counter(families, "sightline_sent_bytes_total", "Bytes to clients, with the framing of HTTP/2.", gate.sent_bytes);
}

// `credentials` may be null.
void add_credentials(const Credentials* credentials, const GateCounts& gate, Families& families) {
  static const Credentials::FileCounts kNone;
  const auto of = [&](const auto& get) -> const Credentials::FileCounts& {
    return credentials ? get(*credentials) : kNone;
  };
  const std::pair<const char*, const Credentials::FileCounts&> files[] = {
      {"access", of([](const Credentials& all) -> auto& { return all.access_file(); })},
      {"certificate", of([](const Credentials& all) -> auto& { return all.certificate(); })}};
  MetricFamily& changes = family(families, "sightline_credential_changes_total",
                                 "Times that a file of credentials had new contents, by file, and by outcome: taken "
                                 "over, or refused because they cannot be used.",
                                 MetricType::Counter);
  for (const auto& [file, counts] : files) {
    counter(changes, static_cast<double>(counts.taken_over), {{"file", file}, {"outcome", "taken_over"}});
    counter(changes, static_cast<double>(counts.refused), {{"file", file}, {"outcome", "refused"}});
  }
  MetricFamily& current = family(
      families, "sightline_credentials_current",
      "1 while the newest contents of the file are in use, 0 while former ones are because the newest cannot be used.",
      MetricType::Gauge);
  for (const auto& [file, counts] : files) gauge(current, counts.current, {{"file", file}});
  const TlsKeys* const tls = credentials ? credentials->tls() : nullptr;
  add_gauge(families, "sightline_certificate_expiry_timestamp_seconds",
            "When the certificate for new connections stops being valid, in seconds since 1970; 0 without TLS.",
            tls ? tls->expires_s() : 0);
  add_counter(families, "sightline_calls_refused_total",
              "Calls refused because their credentials are missing, unknown, or do not allow the call.",
              credentials ? credentials->access().refused() : 0);
  add_counter(families, "sightline_handshakes_failed_total", "Connections on which no TLS connection could be set up.",
              gate.failed_handshakes);
}

void add_memory(const MetricSource& source, Families& families) {
  const ServiceParts& parts = source.parts;
  add_gauge(families, "sightline_geometries", "Distinct geometries in memory; sessions share them.",
            parts.geometry.live_count());
  add_gauge(families, "sightline_geometry_bytes", "Memory of these geometries.", parts.geometry.live_bytes());
  add_gauge(families, "sightline_sampler_geometry_bytes", "Memory that the sampler keeps of them on its device.",
            parts.sampler.geometry_bytes());
}

void add_recording(const MetricSource& source, Families& families) {
  const RecordWriter* const writer = source.parts.recording.writer;
  const RecordCounts counts = writer ? writer->counts() : RecordCounts{};
  add_gauge(families, "sightline_recording_enabled", "1 when the daemon records sessions (--record-dir), otherwise 0.",
            writer != nullptr);
  add_gauge(families, "sightline_recording_folder_usable", "1 when recordings can be written now, otherwise 0.",
            writer && !writer->folder_trouble());
  add_gauge(families, "sightline_recording_sessions", "Open sessions that are being recorded.", counts.open_sessions);
  add_gauge(families, "sightline_recording_sessions_failing", "Recorded sessions that have no file now.",
            counts.failing_sessions);
  add_counter(families, "sightline_recording_messages_total", "Messages written to recordings.", counts.messages);
  add_counter(families, "sightline_recording_bytes_total", "Bytes written to recordings.", counts.bytes);
  add_counter(families, "sightline_recording_dropped_messages_total", "Messages that are missing in recordings.",
              counts.dropped_messages);
  add_counter(families, "sightline_recording_write_failures_total", "Writes to recordings that failed.",
              counts.write_failures);
  add_counter(families, "sightline_recording_files_total", "Files begun.", counts.files);
  add_counter(families, "sightline_recording_removed_files_total", "Files removed by the limits of the folder.",
              counts.removed_files);
}

// The names that Prometheus's own clients use.
void add_process(Families& families) {
  const ProcessFigures process = process_figures();
  add_counter(families, "process_cpu_seconds_total", "Processor time of the process.", process.cpu_s);
  add_gauge(families, "process_resident_memory_bytes", "Memory that the process holds.", process.resident_bytes);
  add_gauge(families, "process_virtual_memory_bytes", "Address space of the process.", process.virtual_bytes);
  add_gauge(families, "process_open_fds", "Open file descriptors.", process.open_descriptors);
  add_gauge(families, "process_max_fds", "File descriptors that may be open.", process.max_descriptors);
  add_gauge(families, "process_threads", "Threads of the process.", process.threads);
  add_gauge(families, "process_start_time_seconds", "Start of the process, in seconds since 1970.", process.start_s);
}

}  // namespace

std::vector<prometheus::MetricFamily> metric_families(const MetricSource& source) {
  const GateCounts gate = source.connections();
  Families families;
  add_daemon(source, families);
  add_sessions(source, families);
  add_cameras(source.parts.sessions, source.parts.clock(), families);
  add_ticks(source, families);
  add_steps(source, families);
  add_limits(source, gate, families);
  add_connections(gate, families);
  add_credentials(source.parts.credentials, gate, families);
  add_memory(source, families);
  add_recording(source, families);
  add_process(families);
  return families;
}

}  // namespace sightline
