#include "server/wire/to_proto.h"

#include <algorithm>
#include <iterator>
#include <string>

#include "server/wire/error_to_proto.h"
#include "server/wire/reason_text.h"

namespace sightline {
namespace {

void set(const glm::dvec3& v, v1::Vec3& out) {
  out.set_x(v.x), out.set_y(v.y), out.set_z(v.z);
}

void set(const Pose& client_pose, v1::Pose3& out) {
  set(client_pose.position_m, *out.mutable_position());
  const glm::dquat& q = client_pose.rotation;
  v1::Quat& rotation = *out.mutable_rotation();
  rotation.set_x(q.x), rotation.set_y(q.y), rotation.set_z(q.z), rotation.set_w(q.w);
}

v1::MoveReason to_proto(MoveReason reason) {
  switch (reason) {
    case MoveReason::kAtDesiredPlace:
      return v1::MOVE_REASON_AT_DESIRED_PLACE;
    case MoveReason::kNearestAllVisible:
      return v1::MOVE_REASON_NEAREST_ALL_VISIBLE;
    case MoveReason::kBestAllVisible:
      return v1::MOVE_REASON_BEST_ALL_VISIBLE;
    case MoveReason::kBestPartial:
      return v1::MOVE_REASON_BEST_PARTIAL;
    case MoveReason::kHorizonGrown:
      return v1::MOVE_REASON_HORIZON_GROWN;
    case MoveReason::kNoTargets:
      return v1::MOVE_REASON_NO_TARGETS;
    case MoveReason::kPaused:
      return v1::MOVE_REASON_PAUSED;
    case MoveReason::kBlockedByGeometry:
      return v1::MOVE_REASON_BLOCKED_BY_GEOMETRY;
    case MoveReason::kBodyOverlap:
      return v1::MOVE_REASON_BODY_OVERLAP;
    case MoveReason::kObservedCut:
      return v1::MOVE_REASON_OBSERVED_CUT;
    case MoveReason::kFarViewpoint:
      return v1::MOVE_REASON_FAR_VIEWPOINT;
    case MoveReason::kOtherShot:
      return v1::MOVE_REASON_OTHER_SHOT;
    case MoveReason::kBestSoon:
      return v1::MOVE_REASON_BEST_SOON;
    case MoveReason::kStays:
      return v1::MOVE_REASON_STAYS;
    case MoveReason::kNearestView:
      return v1::MOVE_REASON_NEAREST_VIEW;
    case MoveReason::kFarWay:
      return v1::MOVE_REASON_FAR_WAY;
    case MoveReason::kCut:
      return v1::MOVE_REASON_CUT;
  }
  return v1::MOVE_REASON_UNSPECIFIED;
}

v1::PairFallback pair_fallback(const StepResult& step) {
  if (!step.pair_asked || step.volume == Volume::kPair) return v1::PAIR_FALLBACK_UNSPECIFIED;
  if (step.pair_needs_two) return v1::PAIR_FALLBACK_NEEDS_TWO_TARGETS;
  if (step.pair_needs_lattice) return v1::PAIR_FALLBACK_NEEDS_LATTICE;
  switch (step.pair_gap) {
    case PairGap::kNone:
      return v1::PAIR_FALLBACK_UNSPECIFIED;
    case PairGap::kTargetInBound:
      return v1::PAIR_FALLBACK_TARGET_IN_BOUND;
    case PairGap::kOnLine:
      return v1::PAIR_FALLBACK_ON_LINE;
    case PairGap::kTooClose:
      return v1::PAIR_FALLBACK_TOO_CLOSE;
  }
  return v1::PAIR_FALLBACK_UNSPECIFIED;
}

// From this share on, a target counts as seen whole.
constexpr double kWholeShare = 0.95;

v1::TargetState state_of(const TargetSight& sight) {
  if (sight.picture_share <= 0) return v1::TARGET_STATE_OFF_SCREEN;
  if (sight.filtered_share <= 0) return v1::TARGET_STATE_OCCLUDED;
  return sight.filtered_share * sight.picture_share >= kWholeShare ? v1::TARGET_STATE_VISIBLE
                                                                   : v1::TARGET_STATE_PARTIAL;
}

void set(const SightForecast& forecast, v1::SightForecast& out) {
  out.set_ahead_s(forecast.ahead_s);
  out.set_share(forecast.share);
  out.set_confidence(forecast.confidence);
  if (forecast.loss_s) out.set_loss_s(*forecast.loss_s);
}

void add_target(const TargetSight& sight, double metres_per_unit, v1::CameraReply& out) {
  v1::TargetVisibility& target = *out.add_targets();
  target.set_id(sight.id);
  target.set_state(state_of(sight));
  target.set_visible_share(sight.visible_share);
  target.set_filtered_share(sight.filtered_share);
  target.set_picture_share(sight.picture_share);
  target.set_distance(sight.distance_m / metres_per_unit);
  target.set_in_picture(sight.in_picture);
  target.set_given_up(sight.given_up);
  for (const Occlusion& occlusion : sight.occlusions) {
    v1::Occluder& occluder = *target.add_occluders();
    occluder.set_id(occlusion.id);
    occluder.set_share(occlusion.share);
  }
  if (sight.forecast) set(*sight.forecast, *target.mutable_forecast());
}

void set(const SightCounts& counts, v1::CandidateCounts& out) {
  out.set_total(counts.total);
  out.set_all_visible(counts.all_visible);
  out.set_some_visible(counts.some_visible);
  out.set_none_visible(counts.none_visible);
  for (const uint32_t count : counts.visible_by_target) out.add_target_visible_counts(count);
}

void set(const StepFlags& flags, v1::StepFlags& out) {
  out.set_dt_capped(flags.dt_capped);
  out.set_used_cube_map(flags.used_cube_map);
  out.set_body_overlap(flags.body_overlap);
  out.set_evading(flags.evading);
  out.set_deflected(flags.deflected);
  out.set_new_shot(flags.new_shot);
  out.set_distance_given_up(flags.distance_given_up);
  out.set_elevation_given_up(flags.elevation_given_up);
}

void set(double asked, double now, double deviation, v1::ShotTerm& out) {
  out.set_asked(asked), out.set_now(now), out.set_deviation(deviation);
}

v1::Course to_proto(FlightCourse course) {
  switch (course) {
    case FlightCourse::kFollow:
      return v1::COURSE_FOLLOW;
    case FlightCourse::kStay:
      return v1::COURSE_STAY;
    case FlightCourse::kPlan:
      return v1::COURSE_PLAN;
    case FlightCourse::kToView:
      return v1::COURSE_TO_VIEW;
    case FlightCourse::kApproach:
      return v1::COURSE_APPROACH;
    case FlightCourse::kFarWay:
      return v1::COURSE_FAR_WAY;
    case FlightCourse::kToShot:
      return v1::COURSE_TO_SHOT;
  }
  return v1::COURSE_UNSPECIFIED;
}

void set(const ComparedCourses& courses, v1::ComparedCourses& out) {
  out.set_taken(to_proto(*courses.taken));
  if (courses.follow_loss) out.set_follow_loss(*courses.follow_loss);
  if (courses.stay_loss) out.set_stay_loss(*courses.stay_loss);
  if (courses.plan_loss) out.set_plan_loss(*courses.plan_loss);
}

void set(const ShotReport& report, const Convention& c, v1::ShotReport& out) {
  const double metres_per_unit = c.metres_per_unit;
  // A client sees the place that is farthest off; behind the camera, no number says how far.
  constexpr double kFarOff = 1e3;
  set(report.asked.side_rad, report.now.side_rad, report.deviation.side, *out.mutable_side());
  set(report.asked.height_rad, report.now.height_rad, report.deviation.height, *out.mutable_height());
  set(report.asked.distance_m / metres_per_unit, report.now.distance_m / metres_per_unit, report.deviation.size,
      *out.mutable_distance());
  set(0.0, std::min(report.off_place, kFarOff), report.deviation.place, *out.mutable_place());
  out.set_sight_loss(report.sight_loss);
  out.set_worth(report.worth);
  constexpr v1::ShotLimit kLimits[] = {v1::SHOT_LIMIT_MIN_DISTANCE, v1::SHOT_LIMIT_MAX_DISTANCE,
                                       v1::SHOT_LIMIT_MIN_ELEVATION, v1::SHOT_LIMIT_MAX_ELEVATION,
                                       v1::SHOT_LIMIT_PICTURE};
  for (size_t i = 0; i < std::size(kLimits); ++i)
    if (report.limits >> i & 1u) out.add_limits(kLimits[i]);
  out.set_hidden_share(report.hidden_share);
  out.set_hidden_by(report.hidden_by);
  out.set_hidden_target(report.hidden_target);
  set(0.0 - report.asked_roll_rad, 0.0 - report.roll_rad, report.roll_deviation, *out.mutable_roll());
  out.set_place_x(report.group_place.x), out.set_place_y(report.group_place.y);
  set(position_to_client(c, report.place_m), *out.mutable_position());
  if (report.soon_by == 0) return;
  v1::ShotObstruction& soon = *out.mutable_next_obstruction();
  soon.set_target(report.soon_target), soon.set_hidden_by(report.soon_by), soon.set_in_s(report.soon_s);
}

void set(int level, const StepSettings& used, v1::Degradation& out) {
  out.set_quality_level(static_cast<uint32_t>(level));
  out.set_map_resolution(static_cast<uint32_t>(used.sample.resolution));
  out.set_sample_points(static_cast<uint32_t>(used.sample.points));
  out.set_candidates(static_cast<uint32_t>(used.aggregate.candidates));
  out.set_search_resolution(static_cast<uint32_t>(used.move.viewpoint_search.resolution));
  out.set_predicted_turns(used.move.turn_probability > 0);
  out.set_predicted_motion(used.move.prediction_s > 0);
}

void set_times(const SessionAnswer& answer, v1::StageTimes& out) {
  const auto us = [](int64_t ns) { return static_cast<float>(static_cast<double>(ns) * 1e-3); };
  const auto stage_ns = [&](Stage stage) { return answer.step.stage_ns[static_cast<size_t>(stage)]; };
  int64_t total_ns = answer.scene_ns;
  for (const int64_t ns : answer.step.stage_ns) total_ns += ns;
  out.set_queue_us(us(answer.queue_ns));
  out.set_scene_us(us(answer.scene_ns));
  out.set_bound_us(us(stage_ns(Stage::kBound)));
  out.set_sample_us(us(stage_ns(Stage::kSample)));
  out.set_aggregate_us(us(stage_ns(Stage::kAggregate)));
  out.set_move_us(us(stage_ns(Stage::kMove)));
  out.set_total_us(us(total_ns));
}

void set_camera(const SessionAnswer& answer, const Convention& c, v1::CameraReply& out) {
  const CameraState& camera = answer.step.camera;
  set(camera_to_client(c, camera.pose), *out.mutable_pose());
  set(vector_to_client(c, camera.velocity_mps), *out.mutable_velocity());
  set(angular_velocity_to_client(c, camera.angular_velocity_radps), *out.mutable_angular_velocity());
  out.set_field_of_view(fov_to_client(c, answer.lens.vertical_fov_rad, answer.lens.aspect));
  if (!answer.relative_target_id) return;
  v1::RelativePose& relative = *out.mutable_relative_pose();
  relative.set_target_id(*answer.relative_target_id);
  set(relative_camera_to_client(c, answer.target_from_camera), *relative.mutable_pose());
  set(relative_camera_to_client(c, answer.unrotated_from_camera), *relative.mutable_unrotated_pose());
}

void set_candidates(const CandidateSet& candidates, int chosen, const Convention& c, v1::Candidates& out) {
  for (const glm::dvec3& position_m : candidates.position_m) {
    const glm::dvec3 p = position_to_client(c, position_m);
    for (int axis = 0; axis < 3; ++axis) out.add_positions(static_cast<float>(p[axis]));
  }
  out.mutable_visible_masks()->Add(candidates.visible_targets.begin(), candidates.visible_targets.end());
  out.set_chosen_index(chosen);
}

// Left and right are those of the picture for either handedness of the client.
void set_depth_map(const DepthMap& map, uint64_t target_id, const Session& session, v1::DepthMap& out) {
  const MapView& view = map.view;
  out.set_target_id(target_id);
  set(view_to_client(session.convention(), view.eye_m, view.world_from_view), *out.mutable_view());
  out.set_left(view.left), out.set_right(view.right);
  out.set_bottom(view.bottom), out.set_top(view.top);
  out.set_width(static_cast<uint32_t>(view.width));
  out.set_height(static_cast<uint32_t>(view.height));
  out.mutable_distances_m()->Add(map.distance_m.begin(), map.distance_m.end());
  const auto instances = session.mirror().instances();
  for (const uint32_t slot : map.occluder) out.add_occluder_ids(slot == kNoOccluder ? 0 : instances[slot].id);
}

void add_depth_maps(const Session& session, v1::CameraReply& out) {
  const std::vector<DepthMap>& taken = session.dump().maps;
  const Sampled& now = session.dump().plan.now;
  for (size_t target = 0; target < now.points_of_target.size(); ++target) {
    const MapRange& points = now.points_of_target[target];
    for (uint32_t p = points.first; p < points.first + points.count; ++p) {
      const MapRange& maps = now.maps_of_point[p];
      for (uint32_t i = maps.first; i < maps.first + maps.count && i < taken.size(); ++i)
        set_depth_map(taken[i], session.targets()[target].instance_id, session, *out.add_depth_maps());
    }
  }
}

v1::TickError::Code to_proto(ErrorCode code) {
  switch (code) {
    case ErrorCode::kInvalidArgument:
    case ErrorCode::kUnsupported:
    case ErrorCode::kDataLoss:
      return v1::TickError::CODE_INVALID_ARGUMENT;
    case ErrorCode::kNotFound:
      return v1::TickError::CODE_NOT_FOUND;
    case ErrorCode::kAlreadyExists:
      return v1::TickError::CODE_ALREADY_EXISTS;
    case ErrorCode::kFailedPrecondition:
      return v1::TickError::CODE_FAILED_PRECONDITION;
    case ErrorCode::kResourceExhausted:
      return v1::TickError::CODE_RESOURCE_EXHAUSTED;
    case ErrorCode::kUnavailable:
      return v1::TickError::CODE_UNAVAILABLE;
    case ErrorCode::kInternal:
      return v1::TickError::CODE_INTERNAL;
  }
  return v1::TickError::CODE_INTERNAL;
}

// A missing file or mesh is not a disagreement about instances.
bool mirrors_disagree(const Error& error) {
  if (error.code == ErrorCode::kNotFound) return error.field.find(".mesh.") == std::string::npos;
  return error.code == ErrorCode::kAlreadyExists || error.field == "tick.delta.base_revision";
}

}  // namespace

v1::TrackingStatus to_proto(TrackingStatus status) {
  switch (status) {
    case TrackingStatus::kTracking:
      return v1::TRACKING_STATUS_TRACKING;
    case TrackingStatus::kPartialView:
      return v1::TRACKING_STATUS_PARTIAL_VIEW;
    case TrackingStatus::kSeeking:
      return v1::TRACKING_STATUS_SEEKING;
    case TrackingStatus::kBlocked:
      return v1::TRACKING_STATUS_BLOCKED;
    case TrackingStatus::kWaiting:
      return v1::TRACKING_STATUS_WAITING;
    case TrackingStatus::kLost:
      return v1::TRACKING_STATUS_LOST;
    case TrackingStatus::kHolding:
      return v1::TRACKING_STATUS_HOLDING;
  }
  return v1::TRACKING_STATUS_UNSPECIFIED;
}

void camera_reply_to_proto(const SessionAnswer& answer, const Session& session, const DiagnosticsWanted& wanted,
                           v1::CameraReply& out) {
  const StepResult& step = answer.step;
  const Convention& c = session.convention();
  out.Clear();
  out.set_sequence(answer.sequence);
  out.set_time_s(answer.time_s);
  out.set_pose_time_s(answer.pose_time_s);
  set_camera(answer, c, out);
  for (const TargetSight& sight : step.targets) add_target(sight, c.metres_per_unit, out);
  set(session.dump().sights.counts, *out.mutable_candidate_counts());
  out.set_status(to_proto(step.status));
  if (step.view_s) out.set_view_s(*step.view_s);
  out.set_blocked_by(step.blocked_by);
  out.set_reason(to_proto(step.reason));
  out.set_reason_text(reason_text(step));
  out.set_cut(answer.cut);
  out.set_volume_used(step.volume == Volume::kPair ? v1::VOLUME_USED_PAIR : v1::VOLUME_USED_LATTICE);
  out.set_pair_fallback(pair_fallback(step));
  set(step.flags, *out.mutable_flags());
  if (answer.degraded) {
    out.mutable_flags()->set_degraded(true);
    set(answer.quality_level, *answer.degraded, *out.mutable_degradation());
  }
  out.set_merged_ticks(answer.merged_ticks);
  out.set_mirror_revision(answer.revision);
  out.set_mirror_hash(answer.hash);
  set_times(answer, *out.mutable_stage_times());
  if (step.shot) set(*step.shot, c, *out.mutable_shot());
  if (step.courses.taken) set(step.courses, *out.mutable_courses());
  if (wanted.candidates)
    set_candidates(session.dump().sights.candidates, step.chosen_candidate, c, *out.mutable_candidates());
  if (wanted.depth_maps) add_depth_maps(session, out);
}

void tick_error_to_proto(const Error& error, uint64_t sequence, const SceneMirror* mirror, v1::TickError& out) {
  out.Clear();
  out.set_sequence(sequence);
  out.set_code(to_proto(error.code));
  out.set_message(describe(error));
  if (!error.field.empty()) {
    v1::FieldViolation& violation = *out.add_field_violations();
    violation.set_field(error.field);
    violation.set_description(error.message);
  }
  if (!mirror || !mirrors_disagree(error)) return;
  out.mutable_resync()->set_mirror_revision(mirror->revision());
  out.mutable_resync()->set_mirror_hash(mirror->hash());
}

void opened_to_proto(const Session& session, v1::SessionOpened& out) {
  out.set_mirror_revision(session.mirror().revision());
  out.set_mirror_hash(session.mirror().hash());
  out.set_instance_count(session.mirror().size());
  out.set_triangle_count(session.triangle_count());
}

}  // namespace sightline
