// A person of eleven capsules on bones, as a game that animates a character has them: the hips, the chest, the head and
// two capsules for each limb. Plain data, which knows nothing of instances.
#pragma once

#include <array>
#include <cmath>

#include "server/base/random.h"
#include "server/scene/primitives.h"

namespace sightline::test {

// A capsule from one end of a bone to the other, where it is in the world.
struct Bone {
  glm::dvec3 from_m{0.0}, to_m{0.0};  // the centres of its caps
  double radius_m = 0.1;

  double half_height_m() const { return glm::distance(from_m, to_m) / 2; }
  CapsuleShape shape() const { return {static_cast<float>(radius_m), static_cast<float>(half_height_m())}; }
  // Turns the capsule's long axis, which is +Y, into the bone.
  Pose pose() const {
    const glm::dvec3 along = glm::normalize(to_m - from_m), up(0, 1, 0);
    const glm::dvec3 axis = glm::cross(up, along);
    const double sine = glm::length(axis);
    const glm::dquat turn = sine > 1e-9   ? glm::angleAxis(std::atan2(sine, along.y), axis / sine)
                            : along.y > 0 ? glm::dquat(1, 0, 0, 0)
                                          : glm::dquat(0, 1, 0, 0);
    return {(from_m + to_m) / 2.0, turn};
  }
};

inline constexpr size_t kBones = 11;  // 0: the hips
inline constexpr size_t kForearms[] = {4, 6};
using Puppet = std::array<Bone, kBones>;

// The directions of the limbs, unit vectors from the body outwards: upper arm, forearm, thigh, shin, of the left and
// the right side.
struct Stance {
  std::array<glm::dvec3, 2> upper_arm, forearm, thigh, shin;
};

inline Stance standing() {
  const glm::dvec3 down(0, -1, 0);
  return {{down, down}, {down, down}, {down, down}, {down, down}};
}

// Arms anywhere outside the chest, legs within a long stride.
inline Stance any_stance(CounterRandom& random) {
  Stance stance;
  const auto around = [&](const glm::dvec3& middle, double spread) {
    const double x = random.next_in(-spread, spread), y = random.next_in(-spread, spread),
                 z = random.next_in(-spread, spread);
    return glm::normalize(middle + glm::dvec3(x, y, z));
  };
  for (int side = 0; side < 2; ++side) {
    const double out = side == 0 ? -1 : 1;
    stance.upper_arm[side] = around({out, -0.2, 0}, 0.9), stance.forearm[side] = around({out, 0, 0}, 0.9);
    stance.thigh[side] = around({0.15 * out, -1, 0}, 0.4), stance.shin[side] = around({0, -1, 0}, 0.3);
  }
  return stance;
}

// 1.75 m tall, with the hips at `hips_m`, turned by `yaw_rad` about the vertical.
inline Puppet puppet_at(const glm::dvec3& hips_m, double yaw_rad, const Stance& stance) {
  Puppet puppet;
  puppet[0] = {{-0.09, 0, 0}, {0.09, 0, 0}, 0.12};
  puppet[1] = {{0, 0.17, 0}, {0, 0.42, 0}, 0.16};
  puppet[2] = {{0, 0.67, 0}, {0, 0.73, 0}, 0.1};
  for (size_t side = 0; side < 2; ++side) {
    const double out = side == 0 ? -1 : 1;
    const auto limb = [&](size_t first, const glm::dvec3& root, const glm::dvec3& upper, const glm::dvec3& lower,
                          double length, double radius) {
      const glm::dvec3 joint = root + length * upper;
      puppet[first] = {root, joint, radius}, puppet[first + 1] = {joint, joint + length * lower, 0.8 * radius};
    };
    limb(3 + 2 * side, {0.2 * out, 0.48, 0}, stance.upper_arm[side], stance.forearm[side], 0.3, 0.055);
    limb(7 + 2 * side, {0.1 * out, -0.05, 0}, stance.thigh[side], stance.shin[side], 0.42, 0.08);
  }
  const glm::dquat turn = glm::angleAxis(yaw_rad, glm::dvec3(0, 1, 0));
  for (Bone& bone : puppet) bone.from_m = hips_m + turn * bone.from_m, bone.to_m = hips_m + turn * bone.to_m;
  return puppet;
}

}  // namespace sightline::test
