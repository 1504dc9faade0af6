#include "server/wire/from_proto_values.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numbers>

#include "server/base/check.h"

namespace sightline {
namespace {

constexpr double kMinFovDegrees = 0.6, kMaxFovDegrees = 171.0;

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%g", value);
  return text;
}

Status read_number(double wire, const std::string& field, double& out) {
  if (!std::isfinite(wire)) return invalid(field, "must be finite, got " + number(wire));
  out = wire;
  return {};
}

Status read_axis(v1::CustomConvention::Axis wire, const std::string& field, glm::dvec3& out) {
  if (!v1::CustomConvention::Axis_IsValid(wire)) return unknown_enum(field, wire);
  if (wire == v1::CustomConvention::AXIS_UNSPECIFIED) return invalid(field, "is required for a custom convention");
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
  if (Status ok = read_axis(wire.camera_forward(), field + ".camera_forward", out.camera_forward); !ok) return ok;
  out.model_front = out.camera_forward;
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

// Messages give the angle in degrees for any convention, because the contract states its range in degrees.
Status check_fov(double fov_degrees, const std::string& field) {
  if (fov_degrees > kMinFovDegrees && fov_degrees < kMaxFovDegrees) return {};
  return invalid(field, "must be in (0.6, 171) degrees, or 0 for the default, got " + number(fov_degrees) + " degrees");
}

// `read`: the former settings with the sent ones applied. If only one end of the zoom range is sent, the error names
// that end.
Status check_zoom(const v1::Settings& sent, const std::string& prefix, const FramingSettings& read) {
  const double low = read.min_vertical_fov_rad, high = read.max_vertical_fov_rad;
  if (sent.has_min_vertical_fov_rad() && !sent.has_max_vertical_fov_rad() && zooms(read) && low > high)
    return invalid(prefix + "settings.min_vertical_fov_rad",
                   "must be in (0.01, " + number(high) + "], got " + number(low));
  if (const Status ok = validate(read); !ok)
    return fail(ok.error().code, prefix + ok.error().field, ok.error().message);
  return {};
}

}  // namespace

tl::unexpected<Error> unknown_enum(const std::string& field, int value) {
  return invalid(field, "must be one of the named values, got " + std::to_string(value));
}

int saturate(uint32_t value) {
  return static_cast<int>(std::min<uint32_t>(value, std::numeric_limits<int>::max()));
}

Status read_vector(const v1::Vec3& wire, const std::string& field, glm::dvec3& out) {
  if (Status ok = read_number(wire.x(), field + ".x", out.x); !ok) return ok;
  if (Status ok = read_number(wire.y(), field + ".y", out.y); !ok) return ok;
  return read_number(wire.z(), field + ".z", out.z);
}

Status read_rotation(const v1::Quat& wire, const std::string& field, glm::dquat& out) {
  const glm::dquat q(wire.w(), wire.x(), wire.y(), wire.z());
  if (!is_unit(q)) return invalid(field, "must have unit length within 1e-3, got length " + number(glm::length(q)));
  out = glm::normalize(q);
  return {};
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
    return invalid(field + ".custom", is_custom ? "is required for CUSTOM" : "must be absent unless preset is CUSTOM");
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

Status read_settings(const v1::Settings& settings, const tuning::v1alpha1::Tuning& tuning, const std::string& prefix,
                     StepSettings& out) {
  if (Status ok = read_settings(settings, prefix + "settings", out); !ok) return ok;
  if (Status ok = read_tuning(tuning, prefix + "tuning", out); !ok) return ok;
  return check_zoom(settings, prefix, out.framing);
}

}  // namespace sightline
