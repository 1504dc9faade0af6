#include "server/move/picture_fit.h"

#include <algorithm>
#include <cmath>

#include "server/base/vector_clones.h"

namespace sightline {
namespace {

constexpr float kShortest = 1e-6f;
constexpr float kNearestM = 0.1f;   // a body is not taken to be nearer than this
constexpr float kFarthest = 20.0f;  // the greatest tangent of an angle from the middle of a picture

SIGHTLINE_VECTOR_CLONES
void add_direction(const float* __restrict x, const float* __restrict y, const float* __restrict z, size_t count,
                   float ax, float ay, float az, float* __restrict sum_x, float* __restrict sum_y,
                   float* __restrict sum_z) {
  for (size_t i = 0; i < count; ++i) {
    const float dx = ax - x[i], dy = ay - y[i], dz = az - z[i];
    const float length = std::sqrt(dx * dx + dy * dy + dz * dz);
    const float inverse = 1.0f / (length > kShortest ? length : kShortest);
    sum_x[i] += dx * inverse, sum_y[i] += dy * inverse, sum_z[i] += dz * inverse;
  }
}

// The axes of a camera that looks along a direction without roll. A direction that is nearly zero stays shorter than 1.
SIGHTLINE_VECTOR_CLONES
void look_without_roll(size_t count, float* __restrict forward_x, float* __restrict forward_y,
                       float* __restrict forward_z, float* __restrict right_x, float* __restrict right_z) {
  for (size_t i = 0; i < count; ++i) {
    const float x = forward_x[i], y = forward_y[i], z = forward_z[i];
    const float level = std::sqrt(x * x + z * z), length = std::sqrt(x * x + y * y + z * z);
    const float inverse_level = 1.0f / (level > kShortest ? level : kShortest),
                inverse = 1.0f / (length > kShortest ? length : kShortest);
    right_x[i] = level > kShortest ? -z * inverse_level : 1.0f;
    right_z[i] = x * inverse_level;
    forward_x[i] = x * inverse, forward_y[i] = y * inverse, forward_z[i] = z * inverse;
  }
}

struct Places {
  const float *x_m, *y_m, *z_m, *forward_x, *forward_y, *forward_z, *right_x, *right_z;
};

// Where a point is in a picture, as tangents of angles from its middle. A point that is not before the camera is
// kFarthest to a side.
struct InPicture {
  float right, up;
};
struct Lean {
  float cosine, sine;  // of the camera's roll
};
inline InPicture in_picture_of(float dx, float dy, float dz, float fx, float fy, float fz, float rx, float rz,
                               const Lean& lean) {
  const float depth = dx * fx + dy * fy + dz * fz;
  const float inverse = 1.0f / (depth > kShortest ? depth : kShortest);
  const float right = (dx * rx + dz * rz) * inverse,
              up = (-dx * rz * fy + dy * (rz * fx - rx * fz) + dz * rx * fy) * inverse;
  const auto limited = [](float tangent) {
    return tangent > kFarthest ? kFarthest : tangent < -kFarthest ? -kFarthest : tangent;
  };
  const float level_right = depth > kShortest ? limited(right)
                            : right < 0.0f    ? -kFarthest
                                              : kFarthest,
              level_up = limited(up);
  return {level_right * lean.cosine + level_up * lean.sine, level_up * lean.cosine - level_right * lean.sine};
}

// The extents of the targets in the pictures, by place.
struct Extents {
  float *least_right, *most_right, *least_up, *most_up;
};

// A body of a vertical axis from the origin of the places.
struct Axis {
  float x_m, low_m, high_m, z_m, aside_m;
};

// The rectangle around a body in the picture.
struct Rectangle {
  float left, right, low, high;
};
inline Rectangle rectangle_of(const Axis& body, float x, float y, float z, float fx, float fy, float fz, float rx,
                              float rz, const Lean& lean) {
  const float dx = body.x_m - x, dz = body.z_m - z, low_m = body.low_m - y, high_m = body.high_m - y;
  const InPicture low = in_picture_of(dx, low_m, dz, fx, fy, fz, rx, rz, lean),
                  high = in_picture_of(dx, high_m, dz, fx, fy, fz, rx, rz, lean);
  const float level = dx * fx + dz * fz, low_depth = level + low_m * fy, high_depth = level + high_m * fy;
  const float depth = low_depth < high_depth ? low_depth : high_depth;
  const float aside = body.aside_m / (depth > kNearestM ? depth : kNearestM), slope = fy < 0 ? -fy : fy;
  const float left = low.right < high.right ? low.right : high.right,
              right = low.right < high.right ? high.right : low.right;
  const float down = low.up < high.up ? low.up : high.up, up = low.up < high.up ? high.up : low.up;
  const float steep = lean.sine < 0 ? -lean.sine : lean.sine;
  const float across = (lean.cosine + slope * steep) * aside, along = (slope * lean.cosine + steep) * aside;
  return {left - across, right + across, down - along, up + along};
}

SIGHTLINE_VECTOR_CLONES
void include(const Places& places, size_t count, const Axis& axis, const Lean& leans, const Extents& extents) {
  const Axis body = axis;
  const Lean lean = leans;
  const float* __restrict x = places.x_m;
  const float* __restrict y = places.y_m;
  const float* __restrict z = places.z_m;
  const float* __restrict fx = places.forward_x;
  const float* __restrict fy = places.forward_y;
  const float* __restrict fz = places.forward_z;
  const float* __restrict rx = places.right_x;
  const float* __restrict rz = places.right_z;
  float* __restrict least_right = extents.least_right;
  float* __restrict most_right = extents.most_right;
  float* __restrict least_up = extents.least_up;
  float* __restrict most_up = extents.most_up;
  SIGHTLINE_NO_OVERLAP
  for (size_t i = 0; i < count; ++i) {
    const Rectangle at = rectangle_of(body, x[i], y[i], z[i], fx[i], fy[i], fz[i], rx[i], rz[i], lean);
    least_right[i] = at.left < least_right[i] ? at.left : least_right[i];
    most_right[i] = at.right > most_right[i] ? at.right : most_right[i];
    least_up[i] = at.low < least_up[i] ? at.low : least_up[i];
    most_up[i] = at.high > most_up[i] ? at.high : most_up[i];
  }
}

// Turns the cameras to the middle of what they should show.
SIGHTLINE_VECTOR_CLONES
void turn_to_middle(const Extents& extents, const Lean& leans, size_t count, float* __restrict forward_x,
                    float* __restrict forward_y, float* __restrict forward_z, const float* __restrict right_x,
                    const float* __restrict right_z) {
  const Lean lean = leans;
  for (size_t i = 0; i < count; ++i) {
    const float across = (extents.least_right[i] + extents.most_right[i]) / 2,
                along = (extents.least_up[i] + extents.most_up[i]) / 2;
    const float right = across * lean.cosine - along * lean.sine, up = across * lean.sine + along * lean.cosine;
    const float x = forward_x[i], y = forward_y[i], z = forward_z[i], rx = right_x[i], rz = right_z[i];
    forward_x[i] = x + right * rx - up * rz * y;
    forward_y[i] = y + up * (rz * x - rx * z);
    forward_z[i] = z + right * rz + up * rx * y;
  }
}

// The share of [low, high] within [-edge, edge].
inline float share_within(float low, float high, float edge) {
  const float from = low > -edge ? low : -edge, to = high < edge ? high : edge;
  const float length = high - low, inside = to - from;
  return inside > 0 ? inside / (length > kShortest ? length : kShortest) : 0.0f;
}

// Adds the weight of a body as far as it is outside. `side` and `top` are the tangents of half the picture.
SIGHTLINE_VECTOR_CLONES
void add_outside(const Places& places, size_t count, const Axis& axis, const Lean& leans, float side, float top,
                 float weight, float* __restrict out) {
  const Axis body = axis;
  const Lean lean = leans;
  const float* __restrict x = places.x_m;
  const float* __restrict y = places.y_m;
  const float* __restrict z = places.z_m;
  const float* __restrict fx = places.forward_x;
  const float* __restrict fy = places.forward_y;
  const float* __restrict fz = places.forward_z;
  const float* __restrict rx = places.right_x;
  const float* __restrict rz = places.right_z;
  for (size_t i = 0; i < count; ++i) {
    const Rectangle at = rectangle_of(body, x[i], y[i], z[i], fx[i], fy[i], fz[i], rx[i], rz[i], lean);
    const float inside = share_within(at.left, at.right, side) * share_within(at.low, at.high, top);
    out[i] += weight * (1.0f - (inside < 1.0f ? inside : 1.0f));
  }
}

}  // namespace

void PictureFit::set_places(std::span<const glm::dvec3> position_m) {
  origin_m_ = position_m.empty() ? glm::dvec3(0.0) : position_m.front();
  for (std::vector<float>* values : {&x_m_, &y_m_, &z_m_, &right_x_, &right_z_}) values->resize(position_m.size());
  for (size_t i = 0; i < position_m.size(); ++i) {
    const glm::vec3 from_origin_m(position_m[i] - origin_m_);
    x_m_[i] = from_origin_m.x, y_m_[i] = from_origin_m.y, z_m_[i] = from_origin_m.z;
  }
}

void PictureFit::outside_share(std::span<const Body> bodies, const Lens& lens, double roll_rad,
                               std::span<float> share) {
  std::fill(share.begin(), share.end(), 0.0f);
  double all = 0;
  for (const Body& body : bodies) all += body.weight;
  if (!(all > 0)) return;
  const size_t count = x_m_.size();
  for (std::vector<float>* sums : {&forward_x_, &forward_y_, &forward_z_}) sums->assign(count, 0.0f);
  for (std::vector<float>* least : {&least_right_, &least_up_}) least->assign(count, kFarthest);
  for (std::vector<float>* most : {&most_right_, &most_up_}) most->assign(count, -kFarthest);
  const auto for_each_body = [&](const auto& visit) {
    for (const Body& body : bodies) {
      if (!(body.weight > 0)) continue;
      const glm::vec3 low_m(body.low_m - origin_m_), high_m(body.high_m - origin_m_);
      visit(Axis{low_m.x, low_m.y, high_m.y, low_m.z, static_cast<float>(body.aside_m)},
            static_cast<float>(body.weight / all));
    }
  };
  for_each_body([&](const Axis& axis, float) {
    add_direction(x_m_.data(), y_m_.data(), z_m_.data(), count, axis.x_m, (axis.low_m + axis.high_m) / 2, axis.z_m,
                  forward_x_.data(), forward_y_.data(), forward_z_.data());
  });
  const Places places{x_m_.data(),       y_m_.data(),       z_m_.data(),     forward_x_.data(),
                      forward_y_.data(), forward_z_.data(), right_x_.data(), right_z_.data()};
  const auto look = [&] {
    look_without_roll(count, forward_x_.data(), forward_y_.data(), forward_z_.data(), right_x_.data(), right_z_.data());
  };
  look();
  const Lean lean{static_cast<float>(std::cos(roll_rad)), static_cast<float>(std::sin(roll_rad))};
  const Extents extents{least_right_.data(), most_right_.data(), least_up_.data(), most_up_.data()};
  for_each_body([&](const Axis& axis, float) { include(places, count, axis, lean, extents); });
  turn_to_middle(extents, lean, count, forward_x_.data(), forward_y_.data(), forward_z_.data(), right_x_.data(),
                 right_z_.data());
  look();
  const double top = std::tan(lens.vertical_fov_rad / 2);
  for_each_body([&](const Axis& axis, float weight) {
    add_outside(places, count, axis, lean, static_cast<float>(top * lens.aspect), static_cast<float>(top), weight,
                share.data());
  });
}

}  // namespace sightline
