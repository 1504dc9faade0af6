#include "server/session/convention.h"

#include <cmath>
#include <numbers>

#include "server/base/check.h"

namespace sightline {
namespace {

constexpr double kRadiansPerDegree = std::numbers::pi / 180;
// Farther from the client's origin, double precision no longer tells places 10 cm apart.
constexpr double kFarthestOriginM = 1e15;

Convention preset(const glm::dmat3& canonical_from_client, double metres_per_unit,
                  // models face along the camera's forward axis
                  const glm::dvec3& camera_forward, const glm::dvec3& camera_up) {
  Convention c;
  c.canonical_from_client = canonical_from_client;
  c.metres_per_unit = metres_per_unit;
  c.camera_forward = camera_forward;
  c.camera_up = camera_up;
  c.model_front = camera_forward;
  return c;
}

bool is_axis(const glm::dvec3& v) {
  const glm::dvec3 a = glm::abs(v);
  return (a.x == 0 || a.x == 1) && (a.y == 0 || a.y == 1) && (a.z == 0 || a.z == 1) && a.x + a.y + a.z == 1;
}

double handedness(const Convention& c) {
  return glm::determinant(c.canonical_from_client);
}

// R' = M R M^T for a rotation about the axial vector (q.x, q.y, q.z): exact, since M only swaps and negates.
glm::dquat turn_axis(const glm::dmat3& m, double sign, const glm::dquat& q) {
  const glm::dvec3 axis = sign * (m * glm::dvec3(q.x, q.y, q.z));
  return {q.w, axis.x, axis.y, axis.z};
}

// The rotation that takes a camera's -Z to `forward` and its +Y to `up`.
glm::dquat looking(const glm::dvec3& forward, const glm::dvec3& up) {
  return glm::normalize(glm::quat_cast(glm::dmat3(glm::cross(forward, up), up, -forward)));
}

// Rotation between the canonical and the client's camera axes, both with canonical handedness.
glm::dquat client_camera_from_camera(const Convention& c) {
  return looking(c.canonical_from_client * c.camera_forward, c.canonical_from_client * c.camera_up);
}

glm::dquat camera_rotation_to_client(const Convention& c, const glm::dquat& r) {
  return rotation_to_client(c, glm::normalize(r * glm::conjugate(client_camera_from_camera(c))));
}

double other_fov(double fov_rad, double factor) {
  return 2 * std::atan(std::tan(fov_rad / 2) * factor);
}

}  // namespace

Convention gltf_convention() {
  return {};
}

Convention godot_convention() {
  Convention c;
  c.degrees = true;
  c.model_front = {0, 0, -1};
  return c;
}

Convention unity_convention() {
  Convention c = preset(glm::dmat3({-1, 0, 0}, {0, 1, 0}, {0, 0, 1}), 1.0, {0, 0, 1}, {0, 1, 0});
  c.degrees = true;
  return c;
}

Convention unreal_convention() {
  Convention c = preset(glm::dmat3({1, 0, 0}, {0, 0, 1}, {0, 1, 0}), 0.01, {1, 0, 0}, {0, 0, 1});
  c.degrees = c.horizontal_fov = true;
  return c;
}

Convention ros_convention() {
  return preset(glm::dmat3({0, 0, 1}, {1, 0, 0}, {0, 1, 0}), 1.0, {1, 0, 0}, {0, 0, 1});
}

Status validate(const Convention& c) {
  const glm::dmat3& m = c.canonical_from_client;
  if (!is_axis(m[0])) return invalid("convention.custom.x", "must be an axis");
  if (!is_axis(m[1]) || glm::dot(m[0], m[1]) != 0)
    return invalid("convention.custom.y", "must be an axis, and another one than x");
  if (!is_axis(m[2]) || glm::dot(m[0], m[2]) != 0 || glm::dot(m[1], m[2]) != 0)
    return invalid("convention.custom.z", "must be an axis, and another one than x and y");
  if (Status ok = check_range("convention.custom.metres_per_unit", c.metres_per_unit, 1e-6, 1e6); !ok) return ok;
  if (!is_axis(c.camera_forward)) return invalid("convention.custom.camera_forward", "must be an axis");
  if (!is_axis(c.camera_up) || glm::dot(c.camera_forward, c.camera_up) != 0)
    return invalid("convention.custom.camera_up", "must be an axis, and not along camera_forward");
  if (!(std::abs(c.origin_m.x) <= kFarthestOriginM && std::abs(c.origin_m.y) <= kFarthestOriginM &&
        std::abs(c.origin_m.z) <= kFarthestOriginM))
    return invalid("world_origin", "each coordinate must be finite and within 1e15 m");
  return {};
}

glm::dvec3 position_from_client(const Convention& c, const glm::dvec3& p_units) {
  return vector_from_client(c, p_units) - c.origin_m;
}

glm::dvec3 position_to_client(const Convention& c, const glm::dvec3& p_m) {
  return vector_to_client(c, p_m + c.origin_m);
}

glm::dvec3 vector_from_client(const Convention& c, const glm::dvec3& v_units) {
  return c.canonical_from_client * v_units * c.metres_per_unit;
}

glm::dvec3 vector_to_client(const Convention& c, const glm::dvec3& v_m) {
  return glm::transpose(c.canonical_from_client) * v_m / c.metres_per_unit;
}

glm::dvec3 extent_from_client(const Convention& c, const glm::dvec3& extent_units) {
  return scale_from_client(c, extent_units) * c.metres_per_unit;
}

glm::dvec3 scale_from_client(const Convention& c, const glm::dvec3& scale) {
  const glm::dmat3& m = c.canonical_from_client;
  return glm::dmat3(glm::abs(m[0]), glm::abs(m[1]), glm::abs(m[2])) * scale;
}

glm::dquat rotation_from_client(const Convention& c, const glm::dquat& r) {
  return turn_axis(c.canonical_from_client, handedness(c), r);
}

glm::dquat rotation_to_client(const Convention& c, const glm::dquat& r) {
  return turn_axis(glm::transpose(c.canonical_from_client), handedness(c), r);
}

glm::dvec3 angular_velocity_from_client(const Convention& c, const glm::dvec3& w) {
  return handedness(c) * (c.canonical_from_client * w);
}

glm::dvec3 angular_velocity_to_client(const Convention& c, const glm::dvec3& w) {
  return handedness(c) * (glm::transpose(c.canonical_from_client) * w);
}

Pose pose_from_client(const Convention& c, const Pose& client_pose) {
  return {position_from_client(c, client_pose.position_m), rotation_from_client(c, client_pose.rotation)};
}

Pose camera_from_client(const Convention& c, const Pose& client_pose) {
  const Pose pose = pose_from_client(c, client_pose);
  return {pose.position_m, glm::normalize(pose.rotation * client_camera_from_camera(c))};
}

Pose camera_to_client(const Convention& c, const Pose& pose) {
  return {position_to_client(c, pose.position_m), camera_rotation_to_client(c, pose.rotation)};
}

Pose relative_camera_to_client(const Convention& c, const Pose& target_from_camera) {
  return {vector_to_client(c, target_from_camera.position_m),
          camera_rotation_to_client(c, target_from_camera.rotation)};
}

Pose view_to_client(const Convention& c, const glm::dvec3& eye_m, const glm::dmat3& world_from_view) {
  Convention looks_along_minus_z = c;
  looks_along_minus_z.camera_forward = {0, 0, -1};
  looks_along_minus_z.camera_up = {0, 1, 0};
  return camera_to_client(looks_along_minus_z, {eye_m, looking(-world_from_view[2], world_from_view[1])});
}

double fov_from_client(const Convention& c, double fov, double aspect) {
  const double fov_rad = c.degrees ? fov * kRadiansPerDegree : fov;
  return c.horizontal_fov ? other_fov(fov_rad, 1 / aspect) : fov_rad;
}

double fov_to_client(const Convention& c, double vertical_rad, double aspect) {
  const double fov_rad = c.horizontal_fov ? other_fov(vertical_rad, aspect) : vertical_rad;
  return c.degrees ? fov_rad / kRadiansPerDegree : fov_rad;
}

}  // namespace sightline
