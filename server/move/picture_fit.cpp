#include "server/move/picture_fit.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>

#include "server/base/vector_clones.h"
#include "server/scene/target.h"

namespace sightline {
namespace {

// A target counts in full at this many times the distance of the picture's edge from its middle. Less makes the camera keep away from targets that it
// passes for a moment.
constexpr float kFarOutside = 1.5f;
constexpr float kShortest = 1e-6f;
constexpr float kFarthest = 20.0f;  // the greatest tangent of an angle from the middle of a picture
// Gaps at which targets are together and apart, in radii of a target.
constexpr double kTogether = 3.0, kApart = 6.0;

// The longest leg of the shortest tree that joins the points of the targets that count (R. C. Prim, "Shortest connection networks and some
// generalizations", 1957).
double widest_gap_m(std::span<const glm::dvec3> aim_m, std::span<const double> sight_weights) {
  std::array<double, kMaxTargets> to_tree_m;
  uint32_t left = 0;
  for (size_t k = 0; k < aim_m.size(); ++k)
    if (sight_weights[k] > 0) to_tree_m[k] = std::numeric_limits<double>::infinity(), left |= 1u << k;
  double widest_m = 0;
  for (bool first = true; left != 0; first = false) {
    size_t nearest = static_cast<size_t>(std::countr_zero(left));
    for (size_t k = nearest; k < aim_m.size(); ++k)
      if (left >> k & 1u && to_tree_m[k] < to_tree_m[nearest]) nearest = k;
    if (!first) widest_m = std::max(widest_m, to_tree_m[nearest]);
    left &= ~(1u << nearest);
    for (size_t k = 0; k < aim_m.size(); ++k)
      if (left >> k & 1u) to_tree_m[k] = std::min(to_tree_m[k], glm::distance(aim_m[k], aim_m[nearest]));
  }
  return widest_m;
}

SIGHTLINE_VECTOR_CLONES
void add_direction(const float* __restrict x, const float* __restrict y, const float* __restrict z, size_t count, float ax, float ay, float az,
                   float* __restrict sum_x, float* __restrict sum_y, float* __restrict sum_z) {
  for (size_t i = 0; i < count; ++i) {
    const float dx = ax - x[i], dy = ay - y[i], dz = az - z[i];
    const float length = std::sqrt(dx * dx + dy * dy + dz * dz);
    const float inverse = 1.0f / (length > kShortest ? length : kShortest);
    sum_x[i] += dx * inverse, sum_y[i] += dy * inverse, sum_z[i] += dz * inverse;
  }
}

// The axes of a camera that looks along a direction without roll. A direction that is nearly zero stays shorter than 1.
SIGHTLINE_VECTOR_CLONES
void look_without_roll(size_t count, float* __restrict forward_x, float* __restrict forward_y, float* __restrict forward_z,
                       float* __restrict right_x, float* __restrict right_z) {
  for (size_t i = 0; i < count; ++i) {
    const float x = forward_x[i], y = forward_y[i], z = forward_z[i];
    const float level = std::sqrt(x * x + z * z), length = std::sqrt(x * x + y * y + z * z);
    const float inverse_level = 1.0f / (level > kShortest ? level : kShortest), inverse = 1.0f / (length > kShortest ? length : kShortest);
    right_x[i] = level > kShortest ? -z * inverse_level : 1.0f;
    right_z[i] = x * inverse_level;
    forward_x[i] = x * inverse, forward_y[i] = y * inverse, forward_z[i] = z * inverse;
  }
}

struct Places {
  const float *x_m, *y_m, *z_m, *forward_x, *forward_y, *forward_z, *right_x, *right_z;
};

// Where a point is in a picture, as tangents of angles from its middle. A point that is not before the camera is kFarthest to a side.
struct InPicture {
  float right, up;
};
inline InPicture in_picture_of(float dx, float dy, float dz, float fx, float fy, float fz, float rx, float rz) {
  const float depth = dx * fx + dy * fy + dz * fz;
  const float inverse = 1.0f / (depth > kShortest ? depth : kShortest);
  const float right = (dx * rx + dz * rz) * inverse, up = (-dx * rz * fy + dy * (rz * fx - rx * fz) + dz * rx * fy) * inverse;
  const auto limited = [](float tangent) { return tangent > kFarthest ? kFarthest : tangent < -kFarthest ? -kFarthest : tangent; };
  return {depth > kShortest ? limited(right) : right < 0.0f ? -kFarthest : kFarthest, limited(up)};
}

// The extents of the targets in the pictures, by place.
struct Extents {
  float *least_right, *most_right, *least_up, *most_up;
};

SIGHTLINE_VECTOR_CLONES
void include(const Places& places, size_t count, float ax, float ay, float az, const Extents& extents) {
  const float *__restrict x = places.x_m, *__restrict y = places.y_m, *__restrict z = places.z_m;
  const float *__restrict fx = places.forward_x, *__restrict fy = places.forward_y, *__restrict fz = places.forward_z;
  const float *__restrict rx = places.right_x, *__restrict rz = places.right_z;
  float *__restrict least_right = extents.least_right, *__restrict most_right = extents.most_right, *__restrict least_up = extents.least_up,
                    *__restrict most_up = extents.most_up;
  for (size_t i = 0; i < count; ++i) {
    const InPicture at = in_picture_of(ax - x[i], ay - y[i], az - z[i], fx[i], fy[i], fz[i], rx[i], rz[i]);
    least_right[i] = at.right < least_right[i] ? at.right : least_right[i];
    most_right[i] = at.right > most_right[i] ? at.right : most_right[i];
    least_up[i] = at.up < least_up[i] ? at.up : least_up[i];
    most_up[i] = at.up > most_up[i] ? at.up : most_up[i];
  }
}

// Turns the cameras to the middle of what they should show.
SIGHTLINE_VECTOR_CLONES
void turn_to_middle(const Extents& extents, size_t count, float* __restrict forward_x, float* __restrict forward_y, float* __restrict forward_z,
                    const float* __restrict right_x, const float* __restrict right_z) {
  for (size_t i = 0; i < count; ++i) {
    const float right = (extents.least_right[i] + extents.most_right[i]) / 2, up = (extents.least_up[i] + extents.most_up[i]) / 2;
    const float x = forward_x[i], y = forward_y[i], z = forward_z[i], rx = right_x[i], rz = right_z[i];
    forward_x[i] = x + right * rx - up * rz * y;
    forward_y[i] = y + up * (rz * x - rx * z);
    forward_z[i] = z + right * rz + up * rx * y;
  }
}

// Adds the weight of a target as far as it is outside. `side` and `top` are the tangents of half the picture.
SIGHTLINE_VECTOR_CLONES
void add_outside(const Places& places, size_t count, float ax, float ay, float az, float side, float top, float weight, float* __restrict out) {
  const float *__restrict x = places.x_m, *__restrict y = places.y_m, *__restrict z = places.z_m;
  const float *__restrict fx = places.forward_x, *__restrict fy = places.forward_y, *__restrict fz = places.forward_z;
  const float *__restrict rx = places.right_x, *__restrict rz = places.right_z;
  const float grows = weight / (kFarOutside - 1.0f);
  for (size_t i = 0; i < count; ++i) {
    const InPicture at = in_picture_of(ax - x[i], ay - y[i], az - z[i], fx[i], fy[i], fz[i], rx[i], rz[i]);
    const float to_side = std::abs(at.right) / side, to_top = std::abs(at.up) / top;
    const float beyond = (to_side > to_top ? to_side : to_top) - 1.0f;
    const float outside = beyond > 0.0f ? beyond * grows : 0.0f;
    out[i] += outside < weight ? outside : weight;
  }
}

SIGHTLINE_VECTOR_CLONES
void limit(size_t count, float most, float* __restrict values) {
  for (size_t i = 0; i < count; ++i) values[i] = values[i] < most ? values[i] : most;
}

}  // namespace

double apart(std::span<const glm::dvec3> aim_m, std::span<const double> sight_weights, double radius_m) {
  return std::clamp((widest_gap_m(aim_m, sight_weights) / radius_m - kTogether) / (kApart - kTogether), 0.0, 1.0);
}

void PictureFit::set_places(std::span<const glm::dvec3> position_m) {
  origin_m_ = position_m.empty() ? glm::dvec3(0.0) : position_m.front();
  for (std::vector<float>* values : {&x_m_, &y_m_, &z_m_, &right_x_, &right_z_}) values->resize(position_m.size());
  for (size_t i = 0; i < position_m.size(); ++i) {
    const glm::vec3 from_origin_m(position_m[i] - origin_m_);
    x_m_[i] = from_origin_m.x, y_m_[i] = from_origin_m.y, z_m_[i] = from_origin_m.z;
  }
}

void PictureFit::outside_share(std::span<const glm::dvec3> aim_m, std::span<const double> sight_weights, const Lens& lens,
                               std::span<float> share) {
  std::fill(share.begin(), share.end(), 0.0f);
  double all = 0, heaviest = 0;
  for (const double weight : sight_weights) all += weight, heaviest = std::max(heaviest, weight);
  if (!(heaviest < all)) return;
  const size_t count = x_m_.size();
  for (std::vector<float>* sums : {&forward_x_, &forward_y_, &forward_z_}) sums->assign(count, 0.0f);
  const auto for_each_target = [&](const auto& visit) {
    for (size_t k = 0; k < aim_m.size(); ++k)
      if (sight_weights[k] > 0) visit(glm::vec3(aim_m[k] - origin_m_), static_cast<float>(sight_weights[k] / all));
  };
  for_each_target([&](const glm::vec3& at_m, float) {
    add_direction(x_m_.data(), y_m_.data(), z_m_.data(), count, at_m.x, at_m.y, at_m.z, forward_x_.data(), forward_y_.data(), forward_z_.data());
  });
  const Places places{x_m_.data(), y_m_.data(), z_m_.data(), forward_x_.data(), forward_y_.data(), forward_z_.data(), right_x_.data(),
                      right_z_.data()};
  const auto look = [&] { look_without_roll(count, forward_x_.data(), forward_y_.data(), forward_z_.data(), right_x_.data(), right_z_.data()); };
  look();
  if (aim_m.size() > 2) {  // for two, the mean direction is the middle
    for (std::vector<float>* least : {&least_right_, &least_up_}) least->assign(count, kFarthest);
    for (std::vector<float>* most : {&most_right_, &most_up_}) most->assign(count, -kFarthest);
    const Extents extents{least_right_.data(), most_right_.data(), least_up_.data(), most_up_.data()};
    for_each_target([&](const glm::vec3& at_m, float) { include(places, count, at_m.x, at_m.y, at_m.z, extents); });
    turn_to_middle(extents, count, forward_x_.data(), forward_y_.data(), forward_z_.data(), right_x_.data(), right_z_.data());
    look();
  }
  const double top = std::tan(lens.vertical_fov_rad / 2);
  for_each_target([&](const glm::vec3& at_m, float weight) {
    add_outside(places, count, at_m.x, at_m.y, at_m.z, static_cast<float>(top * lens.aspect), static_cast<float>(top), weight, share.data());
  });
  limit(count, static_cast<float>((all - heaviest) / all), share.data());
}

}  // namespace sightline
