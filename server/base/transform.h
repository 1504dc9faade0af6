// Rigid poses and affine maps. The canonical frame everywhere below `wire` is glTF's: right-handed, +Y up, metres,
// a camera looks along its -Z with +Y up in the picture. Positions are relative to the session's world origin.
//
// A transform is named by both frames, target first: p_world = world_from_camera * p_camera, so that adjacent frames
// in a product match: world_from_b = world_from_a * a_from_b.
#pragma once

#include <glm/glm.hpp>
#include <glm/gtc/quaternion.hpp>

namespace sightline {

// Rotation then translation. `rotation` has unit length.
struct Pose {
  glm::dvec3 position_m{0.0};
  glm::dquat rotation{1.0, 0.0, 0.0, 0.0};  // glm order in this constructor: w, x, y, z
};

// An affine map: columns are the images of the x, y, z axes and of the origin.
using Affine = glm::dmat4x3;

// Affine from translation, unit rotation and per-axis scale, applied scale first (as a glTF node's TRS).
Affine make_affine(const glm::dvec3& translation_m, const glm::dquat& rotation, const glm::dvec3& scale);
inline Affine identity_affine() {
  return make_affine({0, 0, 0}, {1, 0, 0, 0}, {1, 1, 1});
}

// a * b as affine maps.
Affine compose(const Affine& a, const Affine& b);
// The inverse; the linear part must be invertible (asserted).
Affine inverse(const Affine& a);

inline glm::dvec3 transform_point(const Affine& a, const glm::dvec3& p) {
  return a[0] * p.x + a[1] * p.y + a[2] * p.z + a[3];
}
inline glm::dvec3 transform_vector(const Affine& a, const glm::dvec3& v) {
  return a[0] * v.x + a[1] * v.y + a[2] * v.z;
}
// An upper bound of the factor by which `a` stretches any vector; exact for a rotation times per-axis scale.
double max_stretch(const Affine& a);

inline glm::dvec3 transform_point(const Pose& pose, const glm::dvec3& p) {
  return pose.position_m + pose.rotation * p;
}
inline glm::dvec3 inverse_transform_point(const Pose& pose, const glm::dvec3& p) {
  return glm::conjugate(pose.rotation) * (p - pose.position_m);
}

// The rotation world_from_camera of a camera that looks along unit `forward` with `up_hint` upwards in the picture.
// When the two are (nearly) parallel the picture's right-hand side stays as close as possible to `right_hint`, so
// looking straight up or down is defined and continuous. All inputs non-zero; the result never rolls unless forward is
// parallel to up.
glm::dquat look_rotation(const glm::dvec3& forward, const glm::dvec3& up_hint, const glm::dvec3& right_hint);

// True when every component is finite.
bool is_finite(const glm::dvec3& v);
bool is_finite(const glm::dquat& q);

// Smallest angle in radians between two unit rotations, in [0, pi].
double angle_between(const glm::dquat& a, const glm::dquat& b);

}  // namespace sightline
