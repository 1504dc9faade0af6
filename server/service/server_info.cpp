#include "server/service/server_info.h"

#include <algorithm>

#include "server/base/process_figures.h"
#include "server/record/recorder.h"
#include "server/service/list_sessions.h"

namespace sightline {
namespace {

void set(const RecordCounts& counts, v1::RecordingStats& out) {
  out.set_open_sessions(counts.open_sessions);
  out.set_failing_sessions(counts.failing_sessions);
  out.set_messages(counts.messages);
  out.set_bytes(counts.bytes);
  out.set_dropped_messages(counts.dropped_messages);
  out.set_write_failures(counts.write_failures);
  out.set_files(counts.files);
  out.set_removed_files(counts.removed_files);
}

void set(const DurationCounts& counts, v1::DurationHistogram& out) {
  const auto octaves = counts.by_octave();
  size_t used = octaves.size();
  while (used > 0 && octaves[used - 1] == 0) --used;
  for (size_t i = 0; i < used; ++i) out.add_counts(octaves[i]);
  out.set_sum_s(counts.sum_s());
}

void set(const StepStats& counts, v1::GetServerStatsResponse& stats) {
  stats.set_steps(counts.steps);
  stats.set_degraded_steps(counts.degraded);
  stats.set_late_steps(counts.late);
  stats.set_queue_p50_us(counts.queue.quantile_us(0.5));
  stats.set_queue_p99_us(counts.queue.quantile_us(0.99));
  stats.set_ticks(counts.ticks);
  stats.set_merged_ticks(counts.merged);
  stats.set_refused_ticks(counts.refused);
  stats.set_opened_sessions(counts.opened);
  stats.set_kept_sessions(static_cast<uint32_t>(counts.kept));
  stats.set_resumed_sessions(counts.resumed);
  stats.set_expired_sessions(counts.resume_expired);
  stats.set_refused_resumes(counts.resume_refused);
  set(counts.tick_age, *stats.mutable_tick_age());
  set(counts.queue, *stats.mutable_queue());
  set(counts.step, *stats.mutable_step());
  for (size_t i = 0; i < kStageNames.size(); ++i) {
    v1::StageHistogram& stage = *stats.add_stages();
    stage.set_stage(kStageNames[i]);
    set(counts.stages[i], *stage.mutable_durations());
  }
  for (const auto& sessions : counts.sessions_at_level)
    stats.add_sessions_at_level(static_cast<uint64_t>(std::max<int64_t>(0, sessions)));
}

void set(const GateCounts& counts, v1::GetServerStatsResponse& stats) {
  stats.set_open_connections(counts.open);
  stats.set_received_bytes(counts.received_bytes);
  stats.set_sent_bytes(counts.sent_bytes);
}

}  // namespace

void get_server_info(const ServiceParts& parts, v1::GetServerInfoResponse& info) {
  info.set_version(kVersion);
  info.set_sampler(parts.sampler.kind());
  info.set_sampler_reason(parts.sampler_reason);
  info.set_renderer(parts.sampler.renderer());
  info.set_max_sessions(static_cast<uint32_t>(parts.streams.max_streams()));
}

std::vector<std::pair<std::string_view, uint64_t>> limit_hits(const ServiceParts& parts, const GateCounts& gate) {
  const SceneLibrary::DroppedUploads& dropped = parts.scenes.dropped_uploads();
  std::vector<std::pair<std::string_view, uint64_t>> hits;
  for (size_t i = 0; i < kLimitNames.size(); ++i)
    hits.emplace_back(kLimitNames[i], parts.stats.limits.count(static_cast<Limit>(i)));
  hits[static_cast<size_t>(Limit::kClientScenesMemory)].second += dropped.for_owner;
  hits.emplace_back("kept-uploads-mib", dropped.for_all);
  hits.emplace_back("max-connections", gate.refused - gate.refused_client);
  hits.emplace_back("max-connections-per-client", gate.refused_client);
  return hits;
}

void get_server_stats(const ServiceParts& parts, const Callers& callers, v1::GetServerStatsResponse& stats) {
  stats.set_open_sessions(static_cast<uint32_t>(parts.streams.size()));
  stats.set_geometry_count(parts.geometry.live_count());
  stats.set_geometry_bytes(parts.geometry.live_bytes());
  stats.set_cluster_bytes(parts.geometry.live_bytes_by_part().clusters);
  stats.set_sampler_bytes(parts.sampler.geometry_bytes());
  set(parts.stats, stats);
  const GateCounts gate = callers.connections();
  set(gate, stats);
  for (const auto& [name, count] : limit_hits(parts, gate)) {
    if (count == 0) continue;
    v1::LimitCount& limit = *stats.add_limits();
    limit.set_limit(name.data(), name.size());
    limit.set_count(count);
  }
  camera_figures_to_proto(parts.sessions.sums(), *stats.mutable_cameras());
  const SessionTable::Now now = parts.sessions.now(parts.clock());
  stats.set_blind_sessions(static_cast<uint32_t>(now.blind));
  stats.set_longest_blind_s(now.longest_blind_s);
  const ProcessFigures process = process_figures();
  stats.set_uptime_s(process.uptime_s);
  stats.set_resident_bytes(process.resident_bytes);
  stats.set_cpu_s(process.cpu_s);
  stats.set_step_threads(parts.scheduler.threads());
  if (parts.recording.writer) set(parts.recording.writer->counts(), *stats.mutable_recording());
  v1::AccessStats& access = *stats.mutable_access();
  access.set_refused_calls(callers.credentials().access().refused());
  access.set_failed_handshakes(callers.connections().failed_handshakes);
  access.set_files_taken_over(callers.credentials().taken_over());
  access.set_files_refused(callers.credentials().refused());
}

}  // namespace sightline
