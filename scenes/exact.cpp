#include "scenes/exact.h"

#include <array>
#include <cmath>

namespace sightline::scenes {
namespace {

double to_grid(double value, double steps) {
  return std::floor(value * steps + 0.5) / steps;
}

// Taylor series on |x| <= pi / 4: the first term left out is below 1e-13.
glm::dvec2 small_angle(double x) {
  const double q = x * x;
  const double cosine = 1 -
                        q / 2 *
                            (1 - q / 12 * (1 - q / 30 * (1 - q / 56 * (1 - q / 90 * (1 - q / 132 * (1 - q / 182))))));
  const double sine = x * (1 - q / 6 * (1 - q / 20 * (1 - q / 42 * (1 - q / 72 * (1 - q / 110 * (1 - q / 156))))));
  return {cosine, sine};
}

// (cos, sin) of half of an angle given by its cosine and sine, from whichever half is well conditioned.
glm::dvec2 half_angle(double cosine, double sine) {
  if (cosine >= 0) {
    const double half_cosine = std::sqrt((1 + cosine) / 2);
    return {half_cosine, sine / (2 * half_cosine)};
  }
  const double half_sine = std::sqrt((1 - cosine) / 2);
  return {sine / (2 * half_sine), half_sine};
}

}  // namespace

double snap(double metres) {
  return to_grid(metres, 1024.0);
}

glm::dvec3 snap(const glm::dvec3& metres) {
  return {snap(metres.x), snap(metres.y), snap(metres.z)};
}

glm::dvec3 snap_key(const glm::dvec3& metres) {
  return {to_grid(metres.x, 65536.0), to_grid(metres.y, 65536.0), to_grid(metres.z, 65536.0)};
}

double snapped_in(CounterRandom& random, double low, double high) {
  return snap(random.next_in(low, high));
}

glm::dvec2 circle_point(double turns) {
  const double quarters = turns * 4;
  const double nearest = std::floor(quarters + 0.5);
  const glm::dvec2 p = small_angle((quarters - nearest) * (std::numbers::pi / 2));
  switch (static_cast<int64_t>(nearest) & 3) {
    case 0:
      return p;
    case 1:
      return {-p.y, p.x};
    case 2:
      return {-p.x, -p.y};
    default:
      return {p.y, -p.x};
  }
}

glm::dquat facing(const glm::dvec2& direction_xz) {
  const glm::dvec2 half = half_angle(direction_xz.y, direction_xz.x);
  return {half.x, 0, half.y, 0};
}

glm::dquat quarter_turns(int count) {
  static constexpr std::array<glm::dvec2, 4> kDirections{{{0, 1}, {1, 0}, {0, -1}, {-1, 0}}};
  return facing(kDirections[static_cast<size_t>(count & 3)]);
}

glm::dquat looking(const glm::dvec3& eye_m, const glm::dvec3& at_m) {
  const glm::dvec3 view = at_m - eye_m;
  const double level = std::sqrt(view.x * view.x + view.z * view.z);
  const double length = std::sqrt(level * level + view.y * view.y);
  const glm::dvec2 yaw = half_angle(-view.z / level, -view.x / level);
  const glm::dvec2 pitch = half_angle(level / length, view.y / length);
  return glm::dquat(yaw.x, 0, yaw.y, 0) * glm::dquat(pitch.x, pitch.y, 0, 0);
}

}  // namespace sightline::scenes
