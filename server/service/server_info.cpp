#include "server/service/server_info.h"

#include "server/record/recorder.h"

namespace sightline {
namespace {

void set(const RecordCounts& counts, v1::RecordingCounts& out) {
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

void get_server_info(const ServiceParts& parts, v1::ServerInfo& info) {
  info.set_version(kVersion);
  info.set_sampler(parts.sampler.kind());
  info.set_renderer(parts.sampler.renderer());
  info.set_sampler_reason(parts.sampler_reason);
  info.set_open_sessions(static_cast<uint32_t>(parts.streams.size()));
  info.set_max_sessions(static_cast<uint32_t>(parts.streams.max_streams()));
  info.set_geometry_count(parts.geometry.live_count());
  info.set_cluster_bytes(parts.geometry.live_bytes_by_part().clusters);
  info.set_geometry_bytes(parts.geometry.live_bytes());
  info.set_sampler_bytes(parts.sampler.geometry_bytes());
  info.set_steps(parts.stats.steps);
  info.set_degraded_steps(parts.stats.degraded);
  info.set_late_steps(parts.stats.late);
  info.set_queue_p50_us(parts.stats.queue.quantile_us(0.5));
  info.set_queue_p99_us(parts.stats.queue.quantile_us(0.99));
  if (parts.recording.writer) set(parts.recording.writer->counts(), *info.mutable_recording());
}

}  // namespace sightline
