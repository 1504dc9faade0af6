#include "server/aggregate/look_up.h"

#include <cmath>
#include <limits>

#include "server/base/vector_clones.h"

namespace sightline {
namespace {

// To be looked up singly; in the meantime beside the values of PlaceSight.
constexpr int32_t kUnsureSight = 4;

// Relative rounding error of one operation in single precision.
constexpr double kRounding = 0x1p-24;
// The error of a sum of four products whose factors are themselves rounded is at most 6 roundings of the sum of their sizes.
constexpr double kSumError = 8 * kRounding;
// And that of a squared distance of two rounded points 12 of the squared sizes, 6 more for the limit that it is compared with.
constexpr double kSquareError = 32 * kRounding;

// Linear in the place: dot(slope, place) + at_origin.
struct Row {
  float x = 0, y = 0, z = 0, at_origin = 0;
  float operator()(float px, float py, float pz) const { return x * px + y * py + z * pz + at_origin; }
};

// A map as the loop over places needs it. The texel coordinates are across / depth and up / depth.
struct MapRows {
  Row across, up, depth;
  float eye_x = 0, eye_y = 0, eye_z = 0;  // from the origin
  float width = 0, height = 0;
  int32_t stride = 0;
  float least_depth = 0;      // twice the error of depth: its sign is right beyond it
  float texel_error = 0;      // over depth: how far a texel coordinate may be off,
  float texel_rounding = 0;   // and this more
  float square_error = 0;     // m^2
};

// The bound of a row's error over the places, as said at kSumError.
double error_of(const glm::dvec3& slope, double at_origin, const glm::dvec3& reach_m) {
  return kSumError * (glm::dot(glm::abs(slope), reach_m) + std::abs(at_origin));
}

Row row_of(const glm::dvec3& slope, double at_origin) {
  return {static_cast<float>(slope.x), static_cast<float>(slope.y), static_cast<float>(slope.z),
          static_cast<float>(at_origin)};
}

// With d the computed depth, at least twice its error e_d, a true texel coordinate t and the computed one c differ by
// |c - t| <= (e_x + |t| e_d) / d, so by at most 2 (e_x + size e_d) / d where either lies in the window.
MapRows rows_of(const MapView& view, const glm::dvec3& origin_m, const glm::dvec3& reach_m) {
  const glm::dvec3 eye = view.eye_m - origin_m, back = view.world_from_view[2];
  const double per_width = view.width / (view.right - view.left), per_height = view.height / (view.top - view.bottom);
  const glm::dvec3 across = (view.world_from_view[0] + view.left * back) * per_width,
                   up = (view.world_from_view[1] + view.bottom * back) * per_height;
  const double across_0 = -glm::dot(across, eye), up_0 = -glm::dot(up, eye), depth_0 = glm::dot(back, eye);
  const double depth_error = error_of(back, depth_0, reach_m);
  const double coordinate_error = std::fmax(error_of(across, across_0, reach_m) + view.width * depth_error,
                                            error_of(up, up_0, reach_m) + view.height * depth_error);
  const glm::dvec3 apart = reach_m + glm::abs(eye);
  MapRows rows;
  rows.across = row_of(across, across_0), rows.up = row_of(up, up_0), rows.depth = row_of(-back, depth_0);
  rows.eye_x = static_cast<float>(eye.x), rows.eye_y = static_cast<float>(eye.y), rows.eye_z = static_cast<float>(eye.z);
  rows.width = static_cast<float>(view.width), rows.height = static_cast<float>(view.height);
  rows.stride = view.width;
  rows.least_depth = static_cast<float>(2.1 * depth_error);
  rows.texel_error = static_cast<float>(2.1 * coordinate_error);
  rows.texel_rounding = static_cast<float>(8 * kRounding * std::fmax(view.width, view.height));
  rows.square_error = static_cast<float>(kSquareError * glm::dot(apart, apart));
  return rows;
}

struct Places {
  const float *__restrict x, *__restrict y, *__restrict z;
  size_t count;
};

// The sights of places that no former map has shown. Certain answers are asked for by comparisons that hold, so that what is
// not a number is never certain. `passing` is looked at with kPasses alone.
template <bool kPasses>
[[gnu::always_inline]] inline int32_t look_at(const MapRows map, const Places places, const float* __restrict limit_m2,
                                              const int32_t* __restrict passing, int32_t* __restrict sights) {
  int32_t any_unsure = 0;
  for (size_t i = 0; i < places.count; ++i) {
    const float px = places.x[i], py = places.y[i], pz = places.z[i];
    const float depth = map.depth(px, py, pz), per_depth = 1.0f / depth;
    const float x = map.across(px, py, pz) * per_depth, y = map.up(px, py, pz) * per_depth;
    const float error = map.texel_error * per_depth + map.texel_rounding;
    // Clamped, so that the texel is one of the map's whatever becomes of the answer.
    const float in_x = x > 0.0f ? x : 0.0f, in_y = y > 0.0f ? y : 0.0f;
    const auto column = static_cast<int32_t>(in_x < map.width - 0.5f ? in_x : map.width - 0.5f),
               row = static_cast<int32_t>(in_y < map.height - 0.5f ? in_y : map.height - 0.5f);
    const float of_x = x - static_cast<float>(column), of_y = y - static_cast<float>(row);
    const int32_t texel = row * map.stride + column;
    const float dx = px - map.eye_x, dy = py - map.eye_y, dz = pz - map.eye_z;
    const float squared = dx * dx + dy * dy + dz * dz, limit = limit_m2[texel];

    const bool before = depth > map.least_depth, behind = depth < -map.least_depth;
    const bool inside = before & (of_x > error) & (of_x < 1.0f - error) & (of_y > error) & (of_y < 1.0f - error);
    const bool beside = (x < -error) | (x > map.width + error) | (y < -error) | (y > map.height + error);
    const bool nearer = squared < limit - map.square_error, farther = squared > limit + map.square_error;
    const int32_t hidden = kPasses ? kHiddenSight + passing[texel] : kHiddenSight;
    int32_t sight = behind | (before & beside) ? kUnknownSight : kUnsureSight;
    sight = inside & nearer ? kVisibleSight : sight;
    sight = inside & farther ? hidden : sight;
    sight = sights[i] == kUnknownSight ? sight : sights[i];
    any_unsure |= sight & kUnsureSight;
    sights[i] = sight;
  }
  return any_unsure;
}

SIGHTLINE_VECTOR_CLONES
int32_t look_at_all(const MapRows& map, const Places& places, const float* limit_m2, int32_t* sights) {
  return look_at<false>(map, places, limit_m2, nullptr, sights);
}

SIGHTLINE_VECTOR_CLONES
int32_t look_at_all_passing(const MapRows& map, const Places& places, const float* limit_m2, const int32_t* passing,
                            int32_t* sights) {
  return look_at<true>(map, places, limit_m2, passing, sights);
}

SIGHTLINE_VECTOR_CLONES
void square_limits(const float* distance_m, size_t count, double slack, float* limit_m2) {
  for (size_t i = 0; i < count; ++i) {
    const double limit_m = distance_m[i] * slack;
    // A negative distance sees nothing; its square would.
    limit_m2[i] = static_cast<float>(limit_m < 0 ? std::numeric_limits<double>::quiet_NaN() : limit_m * limit_m);
  }
}

int32_t sight_of(const Sight& sight, std::span<const uint8_t> passes) {
  if (!sight.known) return kUnknownSight;
  if (sight.visible) return kVisibleSight;
  return sight.occluder != kNoOccluder && !passes.empty() && passes[sight.occluder] != 0 ? kPassingSight : kHiddenSight;
}

}  // namespace

Sight look_up(std::span<const DepthMap> maps, const glm::dvec3& point_m, double relative_bias) {
  for (const DepthMap& map : maps) {
    const MapPoint at = project(map.view, point_m);
    if (!at.in_window) continue;
    const int x = static_cast<int>(at.x), y = static_cast<int>(at.y);
    Sight sight{.known = true};
    sight.visible = at.distance_m <= map.distance_at(x, y) * (1.0 + relative_bias);
    if (!sight.visible) sight.occluder = map.occluder_at(x, y);
    return sight;
  }
  return {};
}

void LookUp::set_places(std::span<const glm::dvec3> place_m) {
  place_m_ = place_m;
  const size_t count = place_m.size();
  x_m_.resize(count), y_m_.resize(count), z_m_.resize(count);
  if (count == 0) return;
  glm::dvec3 low = place_m[0], high = place_m[0];
  for (const glm::dvec3& p : place_m) low = glm::min(low, p), high = glm::max(high, p);
  origin_m_ = (low + high) / 2.0;
  reach_m_ = (high - low) * (0.5 + kRounding);
  for (size_t i = 0; i < count; ++i) {
    const glm::dvec3 from_origin = place_m[i] - origin_m_;
    x_m_[i] = static_cast<float>(from_origin.x);
    y_m_[i] = static_cast<float>(from_origin.y);
    z_m_[i] = static_cast<float>(from_origin.z);
  }
}

void LookUp::list_limits(const DepthMap& map, double relative_bias) {
  limit_m2_.resize(map.distance_m.size());
  square_limits(map.distance_m.data(), map.distance_m.size(), 1.0 + relative_bias, limit_m2_.data());
}

// Whether any texel's occluder passes.
bool LookUp::list_passing(const DepthMap& map, std::span<const uint8_t> passes) {
  if (passes.empty()) return false;
  passing_.resize(map.occluder.size());
  int32_t any = 0;
  for (size_t i = 0; i < passing_.size(); ++i) {
    passing_[i] = map.occluder[i] != kNoOccluder && passes[map.occluder[i]] != 0;
    any |= passing_[i];
  }
  return any != 0;
}

// Looks up singly what is unsure.
void LookUp::settle(std::span<const DepthMap> maps, double relative_bias, std::span<const uint8_t> passes) {
  for (size_t i = 0; i < sights_.size(); ++i) {
    if (sights_[i] != kUnsureSight) continue;
    sights_[i] = sight_of(look_up(maps, place_m_[i], relative_bias), passes);
    any_passing_ |= sights_[i] == kPassingSight;
    ++exact_count_;
  }
}

std::span<const int32_t> LookUp::operator()(std::span<const DepthMap> maps, double relative_bias,
                                            std::span<const uint8_t> passes) {
  any_passing_ = false;
  exact_count_ = 0;
  sights_.assign(place_m_.size(), kUnknownSight);
  const Places places{x_m_.data(), y_m_.data(), z_m_.data(), place_m_.size()};
  int32_t unsure = 0;
  for (const DepthMap& map : maps) {
    const MapRows rows = rows_of(map.view, origin_m_, reach_m_);
    list_limits(map, relative_bias);
    const bool passing = list_passing(map, passes);
    any_passing_ |= passing;
    unsure |= passing ? look_at_all_passing(rows, places, limit_m2_.data(), passing_.data(), sights_.data())
                      : look_at_all(rows, places, limit_m2_.data(), sights_.data());
  }
  if (unsure != 0) settle(maps, relative_bias, passes);
  return sights_;
}

}  // namespace sightline
