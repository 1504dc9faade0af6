#include "client/page/page_reply.h"

#include <algorithm>

#include "client/scenario/scenario_session.h"
#include "server/wire/short_name.h"

namespace sightline {
namespace {

uint32_t flag_bits(const v1::StepFlags& flags) {
  const bool set[] = {flags.dt_capped(),          flags.used_cube_map(),     flags.body_overlap(), flags.degraded(),
                      flags.recording_degraded(), flags.evading(),           flags.deflected(),    flags.new_shot(),
                      flags.distance_given_up(),  flags.elevation_given_up()};
  uint32_t bits = 0;
  for (size_t i = 0; i < std::size(set); ++i)
    if (set[i]) bits |= 1u << i;
  return bits;
}

// The page's index of a target; SIZE_MAX when it is none of the page's.
size_t index_of(uint64_t id, std::span<const PageTarget> targets) {
  const auto found = std::find_if(targets.begin(), targets.end(), [id](const PageTarget& t) { return t.id == id; });
  return found == targets.end() ? SIZE_MAX : static_cast<size_t>(found - targets.begin());
}

void say(const v1::TargetVisibility& seen, double metres_per_unit, PageSight& sight) {
  sight.present = true;
  sight.visible_share = seen.visible_share();
  sight.filtered_share = seen.filtered_share();
  sight.state = short_name(seen.state());
  sight.distance_m = seen.distance() * metres_per_unit;
  if (seen.occluders().empty()) return;
  sight.occluder_id = seen.occluders(0).id();
  sight.occluder_share = seen.occluders(0).share();
}

PageShot page_shot(const v1::CameraReply& reply, const Convention& convention) {
  const v1::ShotReport& report = reply.shot();
  const double metres = convention.metres_per_unit;
  PageShot shot;
  const v1::Vec3& p = report.position();
  shot.place_m = position_from_client(convention, {p.x(), p.y(), p.z()});
  shot.asked = {report.side().asked(), report.height().asked(), report.distance().asked() * metres};
  shot.now = {report.side().now(), report.height().now(), report.distance().now() * metres};
  shot.deviation = {report.side().deviation(), report.height().deviation(), report.distance().deviation(),
                    report.place().deviation()};
  shot.sight_loss = report.sight_loss(), shot.worth = report.worth();
  shot.hidden_by = report.hidden_by(), shot.hidden_target = report.hidden_target();
  if (shot.hidden_by == 0 && report.has_next_obstruction()) {
    const v1::ShotObstruction& next = report.next_obstruction();
    shot.hidden_by = next.hidden_by(), shot.hidden_target = next.target(), shot.hidden_in_s = next.in_s();
  }
  if (!reply.has_courses()) return shot;
  const v1::ComparedCourses& courses = reply.courses();
  shot.course = short_name(courses.taken());
  if (courses.has_follow_loss()) shot.losses[0] = courses.follow_loss();
  if (courses.has_stay_loss()) shot.losses[1] = courses.stay_loss();
  if (courses.has_plan_loss()) shot.losses[2] = courses.plan_loss();
  return shot;
}

}  // namespace

std::vector<std::string> page_stages() {
  return {"scene", "bound", "sample", "aggregate", "move"};
}

std::vector<std::string> page_flags() {
  return {"dt capped", "faces resampled", "body overlap", "degraded",          "recording degraded",
          "evading",   "deflected",       "new shot",     "distance given up", "elevation given up"};
}

PageFrame page_frame(const v1::CameraReply& reply, const Convention& convention, double aspect,
                     std::span<const PageTarget> targets) {
  PageFrame frame;
  frame.sequence = reply.sequence();
  frame.time_s = reply.pose_time_s();
  frame.camera = camera_from_client(convention, pose_from(reply.pose()));
  frame.vertical_fov_rad = fov_from_client(convention, reply.field_of_view(), aspect);
  const v1::Vec3& v = reply.velocity();
  frame.velocity_mps = vector_from_client(convention, {v.x(), v.y(), v.z()});
  frame.counts = {reply.candidate_counts().all_visible(), reply.candidate_counts().some_visible(),
                  reply.candidate_counts().none_visible()};
  frame.status = short_name(reply.status());
  frame.reason = short_name(reply.reason());
  frame.text = reply.reason_text();
  if (reply.has_shot()) frame.shot = page_shot(reply, convention);
  frame.cut = reply.cut();
  frame.flags = flag_bits(reply.flags());
  frame.merged_ticks = reply.merged_ticks();
  const v1::StageTimes& times = reply.stage_times();
  frame.queue_us = times.queue_us();
  frame.stage_us = {times.scene_us(), times.bound_us(), times.sample_us(), times.aggregate_us(), times.move_us()};
  frame.sights.resize(targets.size());
  for (size_t k = 0; k < targets.size(); ++k) {
    frame.sights[k].present = false;
    frame.sights[k].steered = targets[k].weight > 0;
  }
  for (const v1::TargetVisibility& seen : reply.targets())
    if (const size_t k = index_of(seen.id(), targets); k != SIZE_MAX)
      say(seen, convention.metres_per_unit, frame.sights[k]);
  return frame;
}

void add_page_cells(const v1::CameraReply& reply, const Convention& convention, std::span<const PageTarget> targets,
                    PageFrame& frame) {
  const v1::Candidates& candidates = reply.candidates();
  std::vector<size_t> bit_of;  // by the reply's target: the page's
  for (const v1::TargetVisibility& seen : reply.targets()) bit_of.push_back(index_of(seen.id(), targets));
  const int count = std::min(candidates.visible_masks_size(), candidates.positions_size() / 3);
  frame.cells.reserve(static_cast<size_t>(count));
  for (int i = 0; i < count; ++i) {
    PageCell& cell = frame.cells.emplace_back();
    cell.position_m = position_from_client(
        convention, {candidates.positions(3 * i), candidates.positions(3 * i + 1), candidates.positions(3 * i + 2)});
    for (size_t k = 0; k < bit_of.size() && k < 32; ++k)
      if ((candidates.visible_masks(i) >> k & 1u) != 0 && bit_of[k] < 32) cell.visible_targets |= 1u << bit_of[k];
  }
  // Without any candidates, `chosen` would be 0.
  frame.chosen_cell = candidates.chosen_index() < count ? std::max(-1, candidates.chosen_index()) : -1;
}

}  // namespace sightline
