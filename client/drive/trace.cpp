#include "client/drive/trace.h"

#include "server/wire/short_name.h"

#include <limits>

namespace sightline {
namespace {

// A field with a comma, a quote or a line break is quoted (RFC 4180).
std::string csv(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + '"';
}

void write_header(std::ostream& out, const Scenario& scenario) {
  out << "sequence,time_s,pose_time_s,x_m,y_m,z_m,qx,qy,qz,qw,vx_mps,vy_mps,vz_mps,vertical_fov_rad,"
         "candidates,s_v,s_p,s_n,status,reason,volume,pair_fallback,merged_ticks,cut,dt_capped,resampled_"
         "faces,"
         "body_overlap,latency_ms,queue_us,scene_us,bound_us,sample_us,aggregate_us,move_us,total_us,"
         "clearance_m,crossed,r_n,r_p,r_p_tolerant";
  for (const ScenarioActor& target : scenario.targets())
    for (const char* column : {"state", "visible_share", "in_picture", "distance_m", "occluder", "occluder_share",
                               "true_alone_px", "true_visible_px", "true_visible_share"})
      out << ',' << csv(target.name + "." + column);
  out << '\n';
}

void write_reply(std::ostream& out, const v1::CameraReply& reply) {
  const auto& p = reply.pose().position();
  const auto& r = reply.pose().rotation();
  const auto& v = reply.velocity();
  const auto& counts = reply.candidate_counts();
  out << reply.sequence() << ',' << reply.time_s() << ',' << reply.pose_time_s() << ',' << p.x() << ',' << p.y() << ','
      << p.z() << ',' << r.x() << ',' << r.y() << ',' << r.z() << ',' << r.w() << ',' << v.x() << ',' << v.y() << ','
      << v.z() << ',' << reply.field_of_view() << ',' << counts.total() << ',' << counts.all_visible() << ','
      << counts.some_visible() << ',' << counts.none_visible() << ',' << short_name(reply.status()) << ','
      << short_name(reply.reason()) << ',' << short_name(reply.volume_used()) << ','
      << short_name(reply.pair_fallback()) << ',' << reply.merged_ticks() << ',' << reply.cut() << ','
      << reply.flags().dt_capped() << ',' << reply.flags().used_cube_map() << ',' << reply.flags().body_overlap();
}

void write_times(std::ostream& out, const PlayedFrame& frame) {
  const auto& times = frame.reply.stage_times();
  out << ',' << frame.latency_ms;
  for (const float us : {times.queue_us(), times.scene_us(), times.bound_us(), times.sample_us(), times.aggregate_us(),
                         times.move_us(), times.total_us()})
    out << ',' << us;
}

void write_truth(std::ostream& out, const FrameTruth* truth) {
  if (truth)
    out << ',' << truth->body.clearance_m << ',' << truth->body.crossed;
  else
    out << ",,";
  if (truth && truth->picture)
    out << ',' << truth->picture->fully_hidden() << ',' << truth->picture->partly_hidden() << ','
        << truth->picture->partly_hidden(kPartialTolerance);
  else
    out << ",,,";
}

void write_sight(std::ostream& out, const v1::TargetVisibility* sight) {
  if (!sight) {
    out << ",,,,,,";
    return;
  }
  out << ',' << short_name(sight->state()) << ',' << sight->visible_share() << ',' << sight->in_picture() << ','
      << sight->distance();
  if (sight->occluders().empty())
    out << ",,";
  else
    out << ',' << sight->occluders(0).id() << ',' << sight->occluders(0).share();
}

const v1::TargetVisibility* sight_of(const v1::CameraReply& reply, uint64_t id) {
  for (const auto& sight : reply.targets())
    if (sight.id() == id) return &sight;
  return nullptr;
}

const TargetTruth* truth_of(const FrameTruth* truth, uint64_t id) {
  if (!truth || !truth->picture) return nullptr;
  for (const TargetTruth& target : truth->picture->targets)
    if (target.id == id) return &target;
  return nullptr;
}

}  // namespace

void write_trace(std::ostream& out, const Scenario& scenario, std::span<const PlayedFrame> frames,
                 std::span<const FrameTruth> truths) {
  const auto precision = out.precision();
  write_header(out, scenario);
  for (size_t i = 0; i < frames.size(); ++i) {
    const FrameTruth* truth = truths.empty() ? nullptr : &truths[i];
    out.precision(std::numeric_limits<double>::max_digits10);  // poses as they came, so that they can be judged again
    write_reply(out, frames[i].reply);
    out.precision(6);
    write_times(out, frames[i]);
    write_truth(out, truth);
    for (const ScenarioActor& target : scenario.targets()) {
      write_sight(out, sight_of(frames[i].reply, target.id));
      if (const TargetTruth* seen = truth_of(truth, target.id))
        out << ',' << seen->alone_pixels << ',' << seen->visible_pixels << ',' << seen->visible_share();
      else
        out << ",,,";
    }
    out << '\n';
  }
  out.precision(precision);
}

}  // namespace sightline
