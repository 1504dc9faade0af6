#include "server/service/list_sessions.h"

#include "server/wire/to_proto.h"

namespace sightline {
namespace {

void set(const SessionRow& row, int64_t now_ns, v1::SessionFigures& out) {
  out.set_session_id(row.id);
  out.set_label(row.label);
  out.set_client(row.client);
  out.set_age_s(static_cast<double>(now_ns - row.opened_ns) * 1e-9);
  out.set_steps(row.steps);
  out.set_quality_level(static_cast<uint32_t>(row.quality_level));
  if (row.steps > 0) out.set_status(to_proto(row.status));
  out.set_blind_s(row.blind_s);
  camera_figures_to_proto(row.sums, *out.mutable_camera());
}

}  // namespace

void camera_figures_to_proto(const CameraSums& sums, v1::CameraFigures& out) {
  const auto status_s = [&](TrackingStatus status) { return sums.status_s[static_cast<size_t>(status)]; };
  out.set_tracking_s(status_s(TrackingStatus::kTracking));
  out.set_partial_view_s(status_s(TrackingStatus::kPartialView));
  out.set_seeking_s(status_s(TrackingStatus::kSeeking));
  out.set_blocked_s(status_s(TrackingStatus::kBlocked));
  out.set_waiting_s(status_s(TrackingStatus::kWaiting));
  out.set_lost_s(status_s(TrackingStatus::kLost));
  out.set_holding_s(status_s(TrackingStatus::kHolding));
  out.set_target_s(sums.target_s);
  out.set_shown_s(sums.shown_s);
  out.set_shot_s(sums.shot_s);
  out.set_shot_kept_s(sums.shot_kept_s);
  out.set_worth_s(sums.worth_s);
  out.set_cuts(sums.cuts);
}

void list_sessions(const SessionTable& table, int64_t now_ns, v1::ListSessionsResponse& response) {
  for (const SessionRow& row : table.rows()) set(row, now_ns, *response.add_sessions());
}

}  // namespace sightline
