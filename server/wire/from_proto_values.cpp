#include "server/wire/from_proto_values.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numbers>

#include "server/base/check.h"
#include "server/step/presets.h"

namespace sightline {
namespace {

constexpr double kMinFovDegrees = 0.6, kMaxFovDegrees = 171.0;

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%g", value);
  return text;
}

// proto3 lets unknown numbers through.
tl::unexpected<Error> unknown_enum(const std::string& field, int value) {
  return invalid(field, "must be one of the named values, got " + std::to_string(value));
}

Status read_number(double wire, const std::string& field, double& out) {
  if (!std::isfinite(wire)) return invalid(field, "must be finite, got " + number(wire));
  out = wire;
  return {};
}

Status read_rotation(const v1::Quat& wire, const std::string& field, glm::dquat& out) {
  const glm::dquat q(wire.w(), wire.x(), wire.y(), wire.z());
  if (!is_unit(q))
    return invalid(field, "must have unit length within 1e-3, got length " + number(glm::length(q)));
  out = glm::normalize(q);
  return {};
}

Status read_axis(v1::CustomConvention::Axis wire, const std::string& field, glm::dvec3& out) {
  if (!v1::CustomConvention::Axis_IsValid(wire)) return unknown_enum(field, wire);
  if (wire == v1::CustomConvention::AXIS_UNSPECIFIED)
    return invalid(field, "is required for a custom convention");
  const int index = wire - v1::CustomConvention::AXIS_PLUS_X;  // +x, -x, +y, -y, +z, -z
  out = glm::dvec3(0.0);
  out[index / 2] = index % 2 == 0 ? 1.0 : -1.0;
  return {};
}

Status read_custom(const v1::CustomConvention& wire, const std::string& field, Convention& out) {
  glm::dmat3& m = out.canonical_from_client;
  if (Status ok = read_axis(wire.x(), field + ".x", m[0]); !ok) return ok;
  if (Status ok = read_axis(wire.y(), field + ".y", m[1]); !ok) return ok;
  if (Status ok = read_axis(wire.z(), field + ".z", m[2]); !ok) return ok;
  if (Status ok = read_axis(wire.camera_forward(), field + ".camera_forward", out.camera_forward); !ok)
    return ok;
  if (Status ok = read_axis(wire.camera_up(), field + ".camera_up", out.camera_up); !ok) return ok;
  out.metres_per_unit = wire.metres_per_unit();
  out.horizontal_fov = wire.horizontal_field_of_view();
  out.degrees = wire.degrees();
  return {};
}

Status read_preset(v1::Convention::Preset wire, const std::string& field, Convention& out) {
  switch (wire) {
    case v1::Convention::PRESET_UNSPECIFIED:
    case v1::Convention::PRESET_GLTF:
      out = gltf_convention();
      return {};
    case v1::Convention::PRESET_GODOT:
      out = godot_convention();
      return {};
    case v1::Convention::PRESET_UNITY:
      out = unity_convention();
      return {};
    case v1::Convention::PRESET_UNREAL:
      out = unreal_convention();
      return {};
    case v1::Convention::PRESET_ROS:
      out = ros_convention();
      return {};
    default:
      return unknown_enum(field, wire);
  }
}

// Degrees, whatever the client's unit: the wire states its range in them.
Status check_fov(double fov_degrees, const std::string& field) {
  if (fov_degrees > kMinFovDegrees && fov_degrees < kMaxFovDegrees) return {};
  return invalid(
      field, "must be in (0.6, 171) degrees, or 0 for the default, got " + number(fov_degrees) + " degrees");
}

int saturate(uint32_t value) {
  return static_cast<int>(std::min<uint32_t>(value, std::numeric_limits<int>::max()));
}

Status read_bound(const v1::Bound& wire, const std::string& field, BoundSettings& out) {
  if (!v1::Bound::Mode_IsValid(wire.mode())) return unknown_enum(field + ".mode", wire.mode());
  if (wire.mode() == v1::Bound::HORIZON) out.mode = BoundMode::kHorizon;
  if (wire.mode() == v1::Bound::PAPER) out.mode = BoundMode::kPaper;
  if (wire.has_horizon_s()) out.horizon_s = wire.horizon_s();
  if (wire.has_max_horizon_s()) out.max_horizon_s = wire.max_horizon_s();
  if (wire.has_paper_n()) out.paper_n = wire.paper_n();
  if (wire.has_towards_m()) out.towards_m = wire.towards_m();
  return {};
}

void read_sample(const v1::Sample& wire, SampleSettings& out) {
  if (wire.has_resolution()) out.resolution = saturate(wire.resolution());
  if (wire.has_points()) out.points = saturate(wire.points());
  if (wire.has_jitter()) out.jitter_texels = wire.jitter();
}

Status read_filter(const v1::Filter& wire, const std::string& field, FilterSettings& out) {
  if (!v1::Filter::Mode_IsValid(wire.mode())) return unknown_enum(field + ".mode", wire.mode());
  if (wire.mode() == v1::Filter::NONE) out.mode = FilterMode::kNone;
  if (wire.mode() == v1::Filter::JOINT) out.mode = FilterMode::kJoint;
  if (wire.mode() == v1::Filter::PER_TARGET) out.mode = FilterMode::kPerTarget;
  if (wire.has_alpha()) out.alpha = wire.alpha();
  if (wire.has_n()) out.n = saturate(wire.n());
  if (wire.has_window_s()) out.window_s = wire.window_s();
  if (wire.has_on()) out.on = wire.on();
  if (wire.has_off()) out.off = wire.off();
  if (wire.has_min_occlusion_s()) out.min_occlusion_s = wire.min_occlusion_s();
  if (wire.has_hold_s()) out.hold_s = wire.hold_s();
  return {};
}

Status read_aggregate(const v1::Aggregate& wire, const std::string& field, AggregateSettings& out) {
  if (!v1::Aggregate::Volume_IsValid(wire.volume())) return unknown_enum(field + ".volume", wire.volume());
  if (wire.volume() == v1::Aggregate::LATTICE) out.volume = Volume::kLattice;
  if (wire.volume() == v1::Aggregate::PAIR) out.volume = Volume::kPair;
  if (wire.has_candidates()) out.candidates = saturate(wire.candidates());
  if (wire.has_relative_bias()) out.relative_bias = wire.relative_bias();
  if (wire.has_needed_share()) out.needed_share = wire.needed_share();
  if (Status ok = read_filter(wire.filter(), field + ".filter", out.filter); !ok) return ok;
  return {};
}

void read_blend(const v1::Blend& wire, BlendSettings& out) {
  if (wire.has_distance()) out.distance = wire.distance();
  if (wire.has_shelter()) out.shelter = wire.shelter();
  if (wire.has_full_depth_m()) out.full_depth_m = wire.full_depth_m();
  if (wire.has_hidden()) out.hidden = wire.hidden();
  if (wire.has_route()) out.route = wire.route();
  if (wire.has_exposure()) out.exposure = wire.exposure();
  if (wire.has_tolerance()) out.tolerance = wire.tolerance();
  if (wire.has_steadiness()) out.steadiness = wire.steadiness();
}

void read_survey(const v1::Survey& wire, SurveySettings& out) {
  if (wire.has_enabled()) out.enabled = wire.enabled();
  if (wire.has_memory_s()) out.memory_s = wire.memory_s();
  if (wire.has_resolution()) out.resolution = saturate(wire.resolution());
  if (wire.has_content()) out.content = wire.content();
  if (wire.has_hold()) out.hold = wire.hold();
}

void read_coherence(const v1::Coherence& wire, CoherenceSettings& out) {
  if (wire.has_visibility()) out.visibility = wire.visibility();
  if (wire.has_view_angle()) out.view_angle = wire.view_angle();
  if (wire.has_height()) out.height = wire.height();
  if (wire.has_distance()) out.distance = wire.distance();
  if (wire.has_screen()) out.screen = wire.screen();
  if (wire.has_responsiveness()) out.responsiveness = wire.responsiveness();
}

Status read_strategy(const v1::Move& wire, const std::string& field, MoveSettings& out) {
  if (!v1::Move::Strategy_IsValid(wire.strategy())) return unknown_enum(field + ".strategy", wire.strategy());
  if (wire.strategy() == v1::Move::BASIC) out.strategy = Strategy::kBasic;
  if (wire.strategy() == v1::Move::ROBUST) out.strategy = Strategy::kRobust;
  if (wire.strategy() == v1::Move::BLEND) out.strategy = Strategy::kBlend;
  return {};
}

Status read_move(const v1::Move& wire, const std::string& field, MoveSettings& out) {
  if (!v1::Move::Follow_IsValid(wire.follow())) return unknown_enum(field + ".follow", wire.follow());
  if (wire.follow() == v1::Move::OFFSET) out.follow = Follow::kOffset;
  if (wire.follow() == v1::Move::STAY) out.follow = Follow::kStay;
  if (wire.has_min_distance_m()) out.min_distance_m = wire.min_distance_m();
  if (wire.has_max_distance_m()) out.max_distance_m = wire.max_distance_m();
  if (wire.has_min_elevation_rad()) out.min_elevation_rad = wire.min_elevation_rad();
  if (wire.has_max_elevation_rad()) out.max_elevation_rad = wire.max_elevation_rad();
  if (wire.has_prediction_s()) out.prediction_s = wire.prediction_s();
  if (wire.has_predictive_power()) out.predictive_power = wire.predictive_power();
  if (wire.has_turn_share()) out.turn_share = wire.turn_share();
  if (wire.has_turn_rad()) out.turn_rad = wire.turn_rad();
  if (wire.has_response_s()) out.response_s = wire.response_s();
  read_blend(wire.blend(), out.blend);
  read_survey(wire.survey(), out.survey);
  read_coherence(wire.coherence(), out.coherence);
  return read_strategy(wire, field, out);
}

void read_framing(const v1::Framing& wire, FramingSettings& out) {
  if (wire.has_margin()) out.margin = wire.margin();
  if (wire.has_dead_zone()) out.dead_zone = wire.dead_zone();
  if (wire.has_response_s()) out.response_s = wire.response_s();
  if (wire.has_min_vertical_fov_rad()) out.min_vertical_fov_rad = wire.min_vertical_fov_rad();
  if (wire.has_max_vertical_fov_rad()) out.max_vertical_fov_rad = wire.max_vertical_fov_rad();
}

// Inside, 0 stands for "no zoom"; on the wire only absence does. `present` is what is sent put over what there is.
Status check_zoom(const v1::Framing& wire, const std::string& field, const FramingSettings& present) {
  const bool has_min = wire.has_min_vertical_fov_rad(), has_max = wire.has_max_vertical_fov_rad();
  if (!has_min && !has_max) return {};
  const double low = present.min_vertical_fov_rad, high = present.max_vertical_fov_rad;
  const std::string min_field = field + ".min_vertical_fov_rad", max_field = field + ".max_vertical_fov_rad";
  if (!has_min && low == 0) return invalid(min_field, "is absent: a zoom range needs both ends");
  if (!has_max && high == 0) return invalid(max_field, "is absent: a zoom range needs both ends");
  if (!(low > 0.01 && low < 3.0)) return invalid(min_field, "must be in (0.01, 3), got " + number(low));
  if (high >= low && high < 3.0) return {};
  if (!has_max) return invalid(min_field, "must be in (0.01, " + number(high) + "], got " + number(low));
  return invalid(max_field, "must be in [" + number(low) + ", 3), got " + number(high));
}

Status start_from_preset(v1::Settings::Preset wire, const std::string& field, StepSettings& out) {
  switch (wire) {
    case v1::Settings::PRESET_UNSPECIFIED:
      return {};
    case v1::Settings::SIGHTLINE:
      out = preset_settings(Preset::kSightline);
      return {};
    case v1::Settings::PAPER:
      out = preset_settings(Preset::kPaper);
      return {};
    default:
      return unknown_enum(field, wire);
  }
}

}  // namespace

Status read_vector(const v1::Vec3& wire, const std::string& field, glm::dvec3& out) {
  if (Status ok = read_number(wire.x(), field + ".x", out.x); !ok) return ok;
  if (Status ok = read_number(wire.y(), field + ".y", out.y); !ok) return ok;
  return read_number(wire.z(), field + ".z", out.z);
}

Status read_pose(const v1::Pose3& wire, const std::string& field, Pose& out) {
  if (wire.has_position())
    if (Status ok = read_vector(wire.position(), field + ".position", out.position_m); !ok) return ok;
  if (!wire.has_rotation()) return {};
  return read_rotation(wire.rotation(), field + ".rotation", out.rotation);
}

Status read_convention(const v1::Convention& wire, const std::string& prefix, Convention& out) {
  const std::string field = prefix + "convention";
  const bool is_custom = wire.preset() == v1::Convention::PRESET_CUSTOM;
  if (is_custom != wire.has_custom())
    return invalid(field + ".custom",
                   is_custom ? "is required for CUSTOM" : "must be absent unless preset is CUSTOM");
  Status ok = is_custom ? read_custom(wire.custom(), field + ".custom", out)
                        : read_preset(wire.preset(), field + ".preset", out);
  if (!ok) return ok;
  if (ok = validate(out); !ok) return fail(ok.error().code, prefix + ok.error().field, ok.error().message);
  return {};
}

Status read_lens(const v1::Lens& wire, const Convention& convention, const std::string& field, Lens& out) {
  if (wire.aspect() != 0) out.aspect = wire.aspect();
  if (wire.near_m() != 0) out.near_m = wire.near_m();
  if (Status ok = check_lens(out, field); !ok) return ok;  // the conversion below needs the aspect
  if (wire.field_of_view() == 0) return {};
  const double degrees = wire.field_of_view() * (convention.degrees ? 1.0 : 180 / std::numbers::pi);
  if (Status ok = check_fov(degrees, field + ".field_of_view"); !ok) return ok;
  out.vertical_fov_rad = fov_from_client(convention, wire.field_of_view(), out.aspect);
  return check_lens(out, field);
}

Status read_settings(const v1::Settings& wire, const std::string& field, StepSettings& out) {
  if (Status ok = start_from_preset(wire.preset(), field + ".preset", out); !ok) return ok;
  if (Status ok = read_bound(wire.bound(), field + ".bound", out.bound); !ok) return ok;
  read_sample(wire.sample(), out.sample);
  if (Status ok = read_aggregate(wire.aggregate(), field + ".aggregate", out.aggregate); !ok) return ok;
  if (Status ok = read_move(wire.move(), field + ".move", out.move); !ok) return ok;
  read_framing(wire.framing(), out.framing);
  return check_zoom(wire.framing(), field + ".framing", out.framing);
}

void read_limits(const v1::CameraLimits& wire, CameraLimits& out) {
  if (wire.has_max_speed_mps()) out.max_speed_mps = wire.max_speed_mps();
  if (wire.has_max_acceleration_mps2()) out.max_acceleration_mps2 = wire.max_acceleration_mps2();
  if (wire.has_max_angular_speed_radps()) out.max_angular_speed_radps = wire.max_angular_speed_radps();
  if (wire.has_max_angular_acceleration_radps2())
    out.max_angular_acceleration_radps2 = wire.max_angular_acceleration_radps2();
  if (wire.has_body_radius_m()) out.body_radius_m = wire.body_radius_m();
}

}  // namespace sightline
