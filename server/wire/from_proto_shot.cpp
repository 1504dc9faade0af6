#include "server/wire/from_proto_shot.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>

#include "server/base/check.h"
#include "server/wire/from_proto_values.h"

namespace sightline {
namespace {

constexpr double kFarthestM = 1e6, kLeastSize = 0.02, kFarthestPlace = 0.9, kMostOrbitRadps = 3.0,
                 kLongestBlendS = 60.0, kMostTolerance = 3.0, kMostWeight = 10.0;
constexpr double kMostRollRad = std::numbers::pi / 4, kFarthestDeadZone = 0.9, kLeastSoftZone = 0.02,
                 kFarthestSoftZone = 2.0, kMostLeadRoom = 0.9;
// A distance that is only just too great is not worth a word.
constexpr double kRounded = 1.01;

Status read_in_range(double wire, const std::string& field, double low, double high, double& out) {
  out = wire;
  return check_range(field.c_str(), wire, low, high);
}

Status read_frame(const v1::Shot& wire, const std::string& field, AskedShot& out) {
  out.frame_id = wire.frame_id(), out.line_to_id = wire.line_to_id();
  switch (wire.frame()) {
    case v1::Shot::FRAME_UNSPECIFIED:
    case v1::Shot::FRAME_WORLD:
      out.frame = ShotFrame::kWorld;
      return {};
    case v1::Shot::FRAME_HEADING:
      out.frame = ShotFrame::kHeading;
      return {};
    case v1::Shot::FRAME_TRAVEL:
      out.frame = ShotFrame::kTravel;
      return {};
    case v1::Shot::FRAME_LINE:
      out.frame = ShotFrame::kLine;
      if (wire.line_to_id() == 0) return invalid(field + ".line_to_id", "is required for FRAME_LINE");
      if (wire.line_to_id() == wire.frame_id())
        return invalid(field + ".line_to_id", "must be another instance than frame_id");
      return {};
    default:
      return unknown_enum(field + ".frame", wire.frame());
  }
}

Status read_front(const v1::Shot& wire, const Convention& convention, const std::string& field, AskedShot& out) {
  glm::dvec3 front = convention.model_front;
  if (wire.has_front())
    if (Status ok = read_vector(wire.front(), field + ".front", front); !ok) return ok;
  const double length = glm::length(front);
  if (length > 0) out.front = convention.canonical_from_client * (front / length);
  if (length > 0 && std::isfinite(length) && yaw_of(out.front)) return {};
  return invalid(field + ".front", "must be a direction that is not vertical");
}

Status read_place(const v1::Shot& wire, const Convention& convention, const std::string& field, AskedShot& out) {
  constexpr double kPi = std::numbers::pi;
  if (wire.has_side_rad())
    if (Status ok = read_in_range(wire.side_rad(), field + ".side_rad", -2 * kPi, 2 * kPi, out.side_rad.emplace()); !ok)
      return ok;
  if (wire.has_height_rad()) {
    constexpr double kRoundedAngle = 1e-3;  // 1.5708 is a right angle to most people
    if (Status ok = read_in_range(wire.height_rad(), field + ".height_rad", -kPi / 2 - kRoundedAngle,
                                  kPi / 2 + kRoundedAngle, out.height_rad.emplace());
        !ok)
      return ok;
    out.height_rad = std::clamp(*out.height_rad, -kPi / 2, kPi / 2);
  }
  out.either_side = wire.either_side();
  if (Status ok = read_in_range(wire.orbit_radps(), field + ".orbit_radps", -kMostOrbitRadps, kMostOrbitRadps,
                                out.orbit_radps);
      !ok)
    return ok;
  if (wire.has_size()) return read_in_range(wire.size(), field + ".size", kLeastSize, 1.0, out.size.emplace());
  if (!wire.has_distance()) return {};
  const double distance_m = wire.distance() * convention.metres_per_unit;
  if (!(distance_m > 0 && distance_m <= kFarthestM))
    return invalid(field + ".distance", "must be over 0 and at most 1e6 m, got " + std::to_string(distance_m) + " m");
  out.distance_m = distance_m;
  return {};
}

Status read_picture_places(const v1::Shot& wire, const std::string& field, AskedShot& out) {
  if (static_cast<size_t>(wire.places_size()) > kMaxShotPlaces)
    return fail(ErrorCode::kResourceExhausted, field + ".places",
                "at most " + std::to_string(kMaxShotPlaces) + ", got " + std::to_string(wire.places_size()));
  for (int i = 0; i < wire.places_size(); ++i) {
    const std::string at = indexed(field + ".places", static_cast<size_t>(i));
    PicturePlace place{.id = wire.places(i).id()};
    if (Status ok = read_in_range(wire.places(i).x(), at + ".x", -kFarthestPlace, kFarthestPlace,
                                  place.half_pictures.x);
        !ok)
      return ok;
    if (Status ok = read_in_range(wire.places(i).y(), at + ".y", -kFarthestPlace, kFarthestPlace,
                                  place.half_pictures.y);
        !ok)
      return ok;
    const auto same = [&](const PicturePlace& other) { return other.id == place.id; };
    if (std::ranges::any_of(out.places, same)) return invalid(at + ".id", "named twice");
    out.places.push_back(place);
  }
  return {};
}

Status read_zones(const v1::Shot& wire, const std::string& field, AskedShot& out) {
  const std::string dead = field + ".dead_zone", soft = field + ".soft_zone";
  if (wire.has_dead_zone()) {
    glm::dvec2& zone = out.dead_zone.emplace();
    if (Status ok = read_in_range(wire.dead_zone().x(), dead + ".x", 0.0, kFarthestDeadZone, zone.x); !ok) return ok;
    if (Status ok = read_in_range(wire.dead_zone().y(), dead + ".y", 0.0, kFarthestDeadZone, zone.y); !ok) return ok;
  }
  const auto read_soft = [&](double sent, double dead_half, const std::string& at, double& zone) -> Status {
    if (sent == 0) return {};
    if (Status ok = read_in_range(sent, at, kLeastSoftZone, kFarthestSoftZone, zone); !ok) return ok;
    return sent > dead_half ? Status{} : invalid(at, "must be greater than in dead_zone");
  };
  const glm::dvec2 least = out.dead_zone.value_or(glm::dvec2(0.0));
  if (Status ok = read_soft(wire.soft_zone().x(), least.x, soft + ".x", out.soft_zone.x); !ok) return ok;
  return read_soft(wire.soft_zone().y(), least.y, soft + ".y", out.soft_zone.y);
}

Status read_lens_range(const v1::Shot& wire, const Convention& convention, double aspect, const std::string& field,
                       AskedShot& out) {
  const double low = wire.min_field_of_view(), high = wire.max_field_of_view();
  if (low == 0 && high == 0) return {};
  const std::string min_field = field + ".min_field_of_view", max_field = field + ".max_field_of_view";
  if (low == 0 || high == 0)
    return invalid(low == 0 ? min_field : max_field, "is required together with the other end of the range");
  out.min_vertical_fov_rad = fov_from_client(convention, low, aspect),
  out.max_vertical_fov_rad = fov_from_client(convention, high, aspect);
  const auto fits = [](double fov_rad) { return fov_rad > kMinFovRad && fov_rad < kMaxFovRad; };
  if (!fits(out.min_vertical_fov_rad)) return invalid(min_field, "must be in (0.01, 3) radians measured vertically");
  if (!fits(out.max_vertical_fov_rad)) return invalid(max_field, "must be in (0.01, 3) radians measured vertically");
  return low <= high ? Status{} : invalid(max_field, "must be at least min_field_of_view");
}

// How the picture moves and leans.
Status read_picture(const v1::Shot& wire, const Convention& convention, double aspect, const std::string& field,
                    AskedShot& out) {
  if (Status ok = read_picture_places(wire, field, out); !ok) return ok;
  if (Status ok = read_zones(wire, field, out); !ok) return ok;
  if (Status ok = read_in_range(wire.lead_room(), field + ".lead_room", 0.0, kMostLeadRoom, out.lead_room); !ok)
    return ok;
  out.lead_by_heading = wire.lead_by_heading();
  constexpr double kRoundedAngle = 1e-3;
  if (Status ok = read_in_range(wire.roll_rad(), field + ".roll_rad", -kMostRollRad - kRoundedAngle,
                                kMostRollRad + kRoundedAngle, out.roll_rad);
      !ok)
    return ok;
  out.roll_rad = -out.roll_rad;  // the contract's turns the other way
  return read_lens_range(wire, convention, aspect, field, out);
}

// From the camera to the middle of the targets with a weight.
std::optional<double> first_distance_m(const SessionOptions& options) {
  glm::dvec3 sum_m(0.0);
  double weight = 0;
  for (const Target& target : options.targets) {
    const auto found = std::ranges::find(options.instances, target.instance_id, &NewInstance::id);
    if (found == options.instances.end() || !(target.weight > 0)) continue;
    const glm::dvec3 aim_m = target.aim_offset_m.value_or(glm::dvec3(found->geometry->bounds.center()));
    sum_m += target.weight * transform_point(found->pose, found->linear * aim_m), weight += target.weight;
  }
  return weight > 0 ? std::optional(glm::distance(options.camera.position_m, sum_m / weight)) : std::nullopt;
}

std::string sentence(const char* format, double asked, double limit) {
  char text[256];
  std::snprintf(text, sizeof text, format, asked, limit);
  return text;
}

}  // namespace

Status read_shot(const v1::Shot& wire, const Convention& convention, double aspect, const std::string& field,
                 AskedShot& out) {
  if (static_cast<size_t>(wire.subject_ids_size()) > kMaxShotSubjects)
    return fail(ErrorCode::kResourceExhausted, field + ".subject_ids",
                "at most " + std::to_string(kMaxShotSubjects) + ", got " + std::to_string(wire.subject_ids_size()));
  out.subject_ids.assign(wire.subject_ids().begin(), wire.subject_ids().end());
  if (Status ok = read_frame(wire, field, out); !ok) return ok;
  if (Status ok = read_front(wire, convention, field, out); !ok) return ok;
  if (Status ok = read_place(wire, convention, field, out); !ok) return ok;
  if (Status ok = read_picture(wire, convention, aspect, field, out); !ok) return ok;
  if (wire.has_weight())
    if (Status ok = read_in_range(wire.weight(), field + ".weight", 0.0, kMostWeight, out.weight); !ok) return ok;
  if (wire.has_tolerance())
    if (Status ok = read_in_range(wire.tolerance(), field + ".tolerance", 0.0, kMostTolerance, out.tolerance); !ok)
      return ok;
  out.cut = wire.cut();
  return read_in_range(wire.blend_s(), field + ".blend_s", 0.0, kLongestBlendS, out.blend_s);
}

std::vector<std::string> shot_warnings(const SessionOptions& options, const std::string& field) {
  std::vector<std::string> warnings;
  const AskedShot& shot = options.shot;
  const MoveSettings& move = options.settings.move;
  const auto warn = [&](const std::string& name, std::string text) {
    warnings.push_back(field + name + ": " + std::move(text));
  };
  if (move.follow == Follow::kOffset && !shot.distance_m && !shot.size && shot.subject_ids.empty())
    if (const std::optional<double> away_m = first_distance_m(options);
        away_m && *away_m > kRounded * move.max_distance_m)
      warnings.push_back(sentence(
          "open.camera: is %.4g m from the targets, beyond settings.max_distance_m, %g m; the camera comes nearer",
          *away_m, move.max_distance_m));
  if (shot.number == 0) return warnings;
  if (move.follow == Follow::kStay) warn("", "has no effect with FOLLOW_STAY");
  if (shot.distance_m && *shot.distance_m > move.max_distance_m)
    warn(".distance", sentence("%g m is beyond settings.max_distance_m, %g m; the camera stays nearer",
                               *shot.distance_m, move.max_distance_m));
  if (shot.distance_m && *shot.distance_m < move.min_distance_m && shot.subject_ids.empty())
    warn(".distance", sentence("%g m is less than settings.min_distance_m, %g m; the camera stays farther away",
                               *shot.distance_m, move.min_distance_m));
  if (shot.height_rad && *shot.height_rad > move.max_elevation_rad)
    warn(".height_rad", sentence("%g is above settings.max_elevation_rad, %g; the camera stays lower", *shot.height_rad,
                                 move.max_elevation_rad));
  if (shot.height_rad && *shot.height_rad < move.min_elevation_rad)
    warn(".height_rad", sentence("%g is below settings.min_elevation_rad, %g; the camera stays higher",
                                 *shot.height_rad, move.min_elevation_rad));
  const auto exists = [&](uint64_t id) {
    return std::ranges::find(options.instances, id, &NewInstance::id) != options.instances.end();
  };
  if (!shot.subject_ids.empty() && std::ranges::none_of(shot.subject_ids, exists))
    warn(".subject_ids", "none is an instance of the scene; the targets count instead");
  if (shot.frame_id != 0 && !exists(shot.frame_id))
    warn(".frame_id", "is no instance of the scene; the shot does not turn");
  if (shot.line_to_id != 0 && !exists(shot.line_to_id))
    warn(".line_to_id", "is no instance of the scene; the shot does not turn");
  return warnings;
}

}  // namespace sightline
