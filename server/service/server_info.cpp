#include "server/service/server_info.h"

#include "server/record/recorder.h"

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

}  // namespace

void get_server_info(const ServiceParts& parts, v1::GetServerInfoResponse& info) {
  info.set_version(kVersion);
  info.set_sampler(parts.sampler.kind());
  info.set_sampler_reason(parts.sampler_reason);
  info.set_renderer(parts.sampler.renderer());
  info.set_max_sessions(static_cast<uint32_t>(parts.streams.max_streams()));
}

void get_server_stats(const ServiceParts& parts, const Callers& callers, v1::GetServerStatsResponse& stats) {
  stats.set_open_sessions(static_cast<uint32_t>(parts.streams.size()));
  stats.set_geometry_count(parts.geometry.live_count());
  stats.set_geometry_bytes(parts.geometry.live_bytes());
  stats.set_cluster_bytes(parts.geometry.live_bytes_by_part().clusters);
  stats.set_sampler_bytes(parts.sampler.geometry_bytes());
  stats.set_steps(parts.stats.steps);
  stats.set_degraded_steps(parts.stats.degraded);
  stats.set_late_steps(parts.stats.late);
  stats.set_queue_p50_us(parts.stats.queue.quantile_us(0.5));
  stats.set_queue_p99_us(parts.stats.queue.quantile_us(0.99));
  if (parts.recording.writer) set(parts.recording.writer->counts(), *stats.mutable_recording());
  v1::AccessStats& access = *stats.mutable_access();
  access.set_refused_calls(callers.credentials().access().refused());
  access.set_failed_handshakes(callers.connections().failed_handshakes);
  access.set_files_taken_over(callers.credentials().taken_over());
  access.set_files_refused(callers.credentials().refused());
}

}  // namespace sightline
