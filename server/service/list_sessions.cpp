#include "server/service/list_sessions.h"

#include <charconv>
#include <optional>
#include <string_view>

#include "server/wire/error_to_proto.h"
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

std::string token_start(const std::string& id_prefix) {
  return id_prefix + '/';
}

// The number of the session that a page ended with.
std::optional<uint64_t> number_of(std::string_view token, const std::string& id_prefix) {
  const std::string start = token_start(id_prefix);
  if (!token.starts_with(start)) return std::nullopt;
  token.remove_prefix(start.size());
  uint64_t number = 0;
  const auto [end, error] = std::from_chars(token.data(), token.data() + token.size(), number);
  if (error != std::errc() || end != token.data() + token.size()) return std::nullopt;
  return number;
}

grpc::Status invalid(const char* field, std::string message) {
  return status_from_error({ErrorCode::kInvalidArgument, field, std::move(message)});
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

grpc::Status list_sessions(const SessionTable& table, const std::string& id_prefix, int64_t now_ns,
                           const v1::ListSessionsRequest& request, v1::ListSessionsResponse& response) {
  if (request.page_size() > kMaxListedSessions)
    return invalid("page_size", "must be in [0, " + std::to_string(kMaxListedSessions) + "], got " +
                                    std::to_string(request.page_size()));
  std::optional<uint64_t> after = 0;
  if (!request.page_token().empty()) after = number_of(request.page_token(), id_prefix);
  if (!after) return invalid("page_token", "is not a token of this server; begin again with the first page");
  const size_t size = request.page_size() > 0 ? request.page_size() : kMaxListedSessions;
  std::vector<SessionRow> rows = table.rows(*after, size + 1);
  if (rows.size() > size) {
    rows.resize(size);
    response.set_next_page_token(token_start(id_prefix) + std::to_string(rows.back().number));
  }
  for (const SessionRow& row : rows) set(row, now_ns, *response.add_sessions());
  return grpc::Status::OK;
}

}  // namespace sightline
