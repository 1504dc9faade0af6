// Arithmetic of vectors and rotations, for the sampler and the camera that never waits. The same formulae hold in
// right-handed and in left-handed frames, because the contract states turns by the frame's own rule.
#pragma once

#include <array>
#include <cmath>

#include "sightline/v1/camera.pb.h"

namespace sightline::live {

using Vector = std::array<double, 3>;      // x, y, z in the client's frame
using Quaternion = std::array<double, 4>;  // x, y, z, w
// A turn is a Vector along its axis, as long as its angle in radians.

inline Vector read(const v1::Vec3& v) {
  return {v.x(), v.y(), v.z()};
}

inline Vector plus(const Vector& a, const Vector& b) {
  return {a[0] + b[0], a[1] + b[1], a[2] + b[2]};
}

inline Vector minus(const Vector& a, const Vector& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}

inline Vector times(double factor, const Vector& a) {
  return {factor * a[0], factor * a[1], factor * a[2]};
}

inline double length(const Vector& a) {
  return std::sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]);
}

inline bool is_finite(const Vector& a) {
  return std::isfinite(a[0]) && std::isfinite(a[1]) && std::isfinite(a[2]);
}

// The identity for a rotation that is absent.
inline Quaternion read(const v1::Quat& q) {
  const double size = std::sqrt(q.x() * q.x() + q.y() * q.y() + q.z() * q.z() + q.w() * q.w());
  if (size == 0) return {0, 0, 0, 1};
  return {q.x() / size, q.y() / size, q.z() / size, q.w() / size};
}

// The rotation that turns by q first, then by p.
inline Quaternion product(const Quaternion& p, const Quaternion& q) {
  return {p[3] * q[0] + p[0] * q[3] + p[1] * q[2] - p[2] * q[1], p[3] * q[1] - p[0] * q[2] + p[1] * q[3] + p[2] * q[0],
          p[3] * q[2] + p[0] * q[1] - p[1] * q[0] + p[2] * q[3], p[3] * q[3] - p[0] * q[0] - p[1] * q[1] - p[2] * q[2]};
}

inline Quaternion inverse(const Quaternion& q) {
  return {-q[0], -q[1], -q[2], q[3]};
}

inline Quaternion rotation_of(const Vector& turn) {
  const double angle = length(turn);
  const double share = angle > 1e-9 ? std::sin(angle / 2) / angle : 0.5;
  return {share * turn[0], share * turn[1], share * turn[2], std::cos(angle / 2)};
}

// The shorter way: at most half a turn.
inline Vector turn_of(const Quaternion& q) {
  const Vector axis{q[0], q[1], q[2]};
  const double sign = q[3] < 0 ? -1 : 1, size = length(axis);
  return times(sign * (size > 1e-9 ? 2 * std::atan2(size, sign * q[3]) / size : 2.0), axis);
}

}  // namespace sightline::live
