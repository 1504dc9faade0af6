#include "server/base/transform.h"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace sightline {

Affine make_affine(const glm::dvec3& translation_m, const glm::dquat& rotation, const glm::dvec3& scale) {
  const glm::dmat3 r = glm::mat3_cast(rotation);
  return Affine(r[0] * scale.x, r[1] * scale.y, r[2] * scale.z, translation_m);
}

Affine compose(const Affine& a, const Affine& b) {
  return Affine(transform_vector(a, b[0]), transform_vector(a, b[1]), transform_vector(a, b[2]),
                transform_point(a, b[3]));
}

Affine inverse(const Affine& a) {
  const glm::dmat3 linear(a[0], a[1], a[2]);
  assert(glm::determinant(linear) != 0.0);
  const glm::dmat3 inv = glm::inverse(linear);
  return Affine(inv[0], inv[1], inv[2], -(inv * a[3]));
}

double max_stretch(const Affine& a) {
  // Gershgorin on the Gram matrix: exact for orthogonal columns (rotation times per-axis scale), an upper bound
  // under shear.
  const double xy = std::abs(glm::dot(a[0], a[1])), yz = std::abs(glm::dot(a[1], a[2])),
               zx = std::abs(glm::dot(a[2], a[0]));
  const double x = glm::dot(a[0], a[0]) + xy + zx, y = glm::dot(a[1], a[1]) + xy + yz,
               z = glm::dot(a[2], a[2]) + yz + zx;
  return std::sqrt(std::max({x, y, z}));
}

glm::dquat look_rotation(const glm::dvec3& forward, const glm::dvec3& up_hint, const glm::dvec3& right_hint) {
  const glm::dvec3 back = -glm::normalize(forward);
  glm::dvec3 right = glm::cross(up_hint, back);
  // Under about 0.06 degrees from the vertical the cross product is noise: take the hint instead.
  if (glm::length(right) < 1e-3 * glm::length(up_hint)) {
    right = right_hint - back * glm::dot(right_hint, back);
    if (glm::length(right) < 1e-9)
      right = glm::cross(std::abs(back.x) < 0.9 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 0, 1), back);
  }
  right = glm::normalize(right);
  return glm::normalize(glm::quat_cast(glm::dmat3(right, glm::cross(back, right), back)));
}

bool is_finite(const glm::dvec3& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

bool is_finite(const glm::dquat& q) {
  return std::isfinite(q.x) && std::isfinite(q.y) && std::isfinite(q.z) && std::isfinite(q.w);
}

double angle_between(const glm::dquat& a, const glm::dquat& b) {
  const glm::dquat d = glm::conjugate(a) * b;
  return 2.0 * std::atan2(std::sqrt(d.x * d.x + d.y * d.y + d.z * d.z), std::abs(d.w));
}

}  // namespace sightline
