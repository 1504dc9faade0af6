// Conversion between the client's convention and the canonical frame (design 2).
//
// Let M be the matrix whose columns are the canonical images of the client's axes (a signed permutation) and
// s the metres per unit. Then p_canonical = s M p_client - origin and R_canonical = M R_client M^T, which is a
// rotation even where M mirrors. A camera's rotation is rebuilt from its forward and up axes, since the client's
// camera may look along another axis.
//
// The client's up axis is the one whose image is canonical +Y or -Y. Its capsules and cylinders have their long axis
// along it. Meshes of scene files are in glTF's frame. A client that imports such a mesh must convert every vertex by
// the same rule; an instance with the identity pose then matches it.
#pragma once

#include <glm/glm.hpp>

#include "server/base/camera.h"
#include "server/base/error.h"
#include "server/base/transform.h"

namespace sightline {

struct Convention {
  glm::dmat3 canonical_from_client{1.0};  // signed permutation; determinant -1 for left-handed clients
  double metres_per_unit = 1.0;           // [1e-6, 1e6]
  // client axes; the direction in which a camera with the identity rotation looks
  glm::dvec3 camera_forward{0, 0, -1};
  glm::dvec3 camera_up{0, 1, 0};    // client axes; the up direction of its picture
  glm::dvec3 model_front{0, 0, 1};  // client axes; the direction along which models face
  bool horizontal_fov = false;      // fields of view are horizontal ones
  bool degrees = false;             // and in degrees
  glm::dvec3 origin_m{0.0};         // canonical metres; subtracted from every position
};

Convention gltf_convention();
Convention godot_convention();
Convention unity_convention();
Convention unreal_convention();
// ros (x, y, z) = gltf (z, x, y): a glTF asset's front, +Z, is ROS's forward, +X.
Convention ros_convention();
// Fails (kInvalidArgument; field "convention.custom.<...>") unless the columns are a signed permutation,
// forward and up are different axes, the scale is in range and the origin within 1e15 m (field "world_origin").
Status validate(const Convention& convention);

glm::dvec3 position_from_client(const Convention& c, const glm::dvec3& p_units);
glm::dvec3 position_to_client(const Convention& c, const glm::dvec3& p_m);
glm::dvec3 vector_from_client(const Convention& c, const glm::dvec3& v_units);  // velocities, offsets
glm::dvec3 vector_to_client(const Convention& c, const glm::dvec3& v_m);
// Extents along axes: signs dropped, axes permuted, scaled.
glm::dvec3 extent_from_client(const Convention& c, const glm::dvec3& extent_units);
// Per-axis factors: axes permuted, not scaled by the unit.
glm::dvec3 scale_from_client(const Convention& c, const glm::dvec3& scale);
glm::dquat rotation_from_client(const Convention& c, const glm::dquat& r);
glm::dquat rotation_to_client(const Convention& c, const glm::dquat& r);
// Angular velocity is an axial vector: under a mirror it changes sign.
glm::dvec3 angular_velocity_from_client(const Convention& c, const glm::dvec3& w);
glm::dvec3 angular_velocity_to_client(const Convention& c, const glm::dvec3& w);
// world_from_object.
Pose pose_from_client(const Convention& c, const Pose& client_pose);
// world_from_camera with the client's own camera axes.
Pose camera_from_client(const Convention& c, const Pose& client_pose);
Pose camera_to_client(const Convention& c, const Pose& pose);
// The camera in the frame of a target, turned with it or not: no origin takes part.
Pose relative_camera_to_client(const Convention& c, const Pose& target_from_camera);
// world_from_view of a depth map (columns right, up, back) as the client's pose that looks along its own -Z
// with +Y up.
Pose view_to_client(const Convention& c, const glm::dvec3& eye_m, const glm::dmat3& world_from_view);
// Full field of view in the client's axis and unit <-> vertical radians.
double fov_from_client(const Convention& c, double fov, double aspect);
double fov_to_client(const Convention& c, double vertical_rad, double aspect);

}  // namespace sightline
