#include "server/move/picture_worth.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "server/base/vector_clones.h"

namespace sightline {
namespace {

constexpr double kShortestM = 1e-9;

double deviation(double difference, const FreeBand& band, double tolerance) {
  const double free = band.free * tolerance;
  return std::max(0.0, std::abs(difference) - free) / (band.limit - free);
}

// From above 60 degrees, the side of a shot says less and less, until it has none from right above. `cosine`: of the
// elevation.
double side_share(double cosine) {
  return std::min(1.0, 2 * cosine);
}

// ---- the same for many places, in forms that become vector instructions ----

constexpr auto kPi = std::numbers::pi_v<float>;
constexpr float kShortest2 = 1e-12f;

// atan2 for y >= 0, [0, pi]. The polynomial is that of Abramowitz and Stegun, Handbook of Mathematical
// Functions, 4.4.49; its error is at most 1e-5.
inline float angle_of(float y, float x) {
  const float across = x < 0 ? -x : x;
  const float least = y < across ? y : across, most = y < across ? across : y;
  const float t = least / (most > kShortest2 ? most : kShortest2), t2 = t * t;
  const float low = t * (0.9998660f + t2 * (-0.3302995f + t2 * (0.1801410f + t2 * (-0.0851330f + t2 * 0.0208351f))));
  const float acute = y < across ? low : kPi / 2 - low;
  return x < 0 ? kPi - acute : acute;
}

// The logarithm to the base 2 of a number > 0. The exponent is exact; that of the rest, in [1, 2), is 2 atanh(u) / ln 2
// with u = (m - 1) / (m + 1).
inline float log2_of(float value) {
  const uint32_t bits = std::bit_cast<uint32_t>(value);
  const auto exponent = static_cast<float>(static_cast<int32_t>(bits >> 23) - 127);
  const float rest = std::bit_cast<float>((bits & 0x007fffffu) | 0x3f800000u);
  const float u = (rest - 1.0f) / (rest + 1.0f), u2 = u * u;
  return exponent + u * (2.8853901f + u2 * (0.9617967f + u2 * (0.5770780f + u2 * 0.4121986f)));
}

inline float beyond(float difference, float free, float per_unit) {
  const float size = difference < 0 ? -difference : difference;
  const float over = size - free;
  return over > 0 ? over * per_unit : 0.0f;
}

struct Asked {
  float side_x, side_z;  // horizontal, of unit length; zero for a shot from straight above
  float height_rad, distance2_log2;
  float side, height, size;  // weight by one unit beyond the free band
  float side_free, height_free, size_free;
};

SIGHTLINE_VECTOR_CLONES
void losses_of(const float* __restrict x, const float* __restrict y, const float* __restrict z, size_t count, float cx,
               float cy, float cz, const Asked& asked, float* __restrict losses) {
  const float side_x = asked.side_x, side_z = asked.side_z, height_rad = asked.height_rad,
              distance2_log2 = asked.distance2_log2;
  const float per_side = asked.side, per_height = asked.height, per_size = asked.size;
  const float side_free = asked.side_free, height_free = asked.height_free, size_free = asked.size_free;
  for (size_t i = 0; i < count; ++i) {
    const float dx = x[i] - cx, dy = y[i] - cy, dz = z[i] - cz;
    const float level2 = dx * dx + dz * dz, level = std::sqrt(level2), distance2 = level2 + dy * dy;
    const float up = dy < 0 ? -dy : dy, elevation = angle_of(up, level);
    const float across = dx * side_z - dz * side_x;
    const float turn_rad = angle_of(across < 0 ? -across : across, dx * side_x + dz * side_z);
    const float distance = std::sqrt(distance2),
                side_counts = 2.0f * level / (distance > kShortest2 ? distance : kShortest2);
    losses[i] = beyond((dy < 0 ? -elevation : elevation) - height_rad, height_free, per_height) +
                (side_counts < 1.0f ? side_counts : 1.0f) * beyond(turn_rad, side_free, per_side) +
                beyond(0.5f * (log2_of(distance2 > kShortest2 ? distance2 : kShortest2) - distance2_log2), size_free,
                       per_size);
  }
}

float per_unit(double weight, const FreeBand& band, double tolerance) {
  return static_cast<float>(weight / (band.limit - band.free * tolerance));
}

}  // namespace

ShotProperties shot_from(const glm::dvec3& offset_m, double vertical_fov_rad) {
  ShotProperties shot;
  shot.side_rad = std::atan2(offset_m.x, offset_m.z);
  shot.has_side = std::hypot(offset_m.x, offset_m.z) > kShortestM;
  shot.height_rad = std::atan2(offset_m.y, std::hypot(offset_m.x, offset_m.z));
  shot.size_log2 = -std::log2(2 * std::max(glm::length(offset_m), kShortestM) * std::tan(vertical_fov_rad / 2));
  return shot;
}

ShotDeviation deviation_between(const ShotProperties& asked, const ShotProperties& now, double tolerance) {
  const glm::dvec2 shift = now.place_half_pictures - asked.place_half_pictures;
  const double farther = std::max(std::abs(shift.x), std::abs(shift.y));
  const double turn_rad = asked.has_side && now.has_side
                              ? std::remainder(now.side_rad - asked.side_rad, 2 * std::numbers::pi)
                              : 0.0;
  const double side_counts = side_share(std::cos(asked.height_rad)) * side_share(std::cos(now.height_rad));
  return {.side = side_counts * deviation(turn_rad, kSideBandRad, tolerance),
          .height = deviation(now.height_rad - asked.height_rad, kHeightBandRad, tolerance),
          .size = deviation(now.size_log2 - asked.size_log2, kSizeBandLog2, tolerance),
          .place = std::isfinite(farther) ? deviation(farther, kPlaceBandHalfPictures, tolerance) : 1.0};
}

ShotDeviation up_to_limits(const ShotDeviation& deviation) {
  return {std::min(deviation.side, 1.0), std::min(deviation.height, 1.0), std::min(deviation.size, 1.0),
          std::min(deviation.place, 1.0)};
}

double shot_loss(const ShotDeviation& deviation, const ShotWeights& weights) {
  return unbounded_shot_loss(up_to_limits(deviation), weights);
}

double unbounded_shot_loss(const ShotDeviation& deviation, const ShotWeights& weights) {
  return weights.side * deviation.side + weights.height * deviation.height + weights.size * deviation.size +
         weights.place * deviation.place;
}

double picture_worth(double sight_loss, double shot_loss) {
  return std::clamp(1 - sight_loss - shot_loss, 0.0, 1.0);
}

void unbounded_shot_losses(const ShotPlaces& places, const glm::dvec3& asked_m, const ShotWeights& weights,
                           float* losses, double tolerance) {
  const double level_m = std::hypot(asked_m.x, asked_m.z);
  const bool has_side = level_m > kShortestM;
  const Asked asked{.side_x = has_side ? static_cast<float>(asked_m.x / level_m) : 0.0f,
                    .side_z = has_side ? static_cast<float>(asked_m.z / level_m) : 0.0f,
                    .height_rad = static_cast<float>(std::atan2(asked_m.y, level_m)),
                    .distance2_log2 = static_cast<float>(2 * std::log2(std::max(glm::length(asked_m), kShortestM))),
                    .side = has_side ? per_unit(weights.side, kSideBandRad, tolerance) *
                                           static_cast<float>(side_share(level_m / glm::length(asked_m)))
                                     : 0.0f,
                    .height = per_unit(weights.height, kHeightBandRad, tolerance),
                    .size = per_unit(weights.size, kSizeBandLog2, tolerance),
                    .side_free = static_cast<float>(kSideBandRad.free * tolerance),
                    .height_free = static_cast<float>(kHeightBandRad.free * tolerance),
                    .size_free = static_cast<float>(kSizeBandLog2.free * tolerance)};
  losses_of(places.x_m, places.y_m, places.z_m, places.count, places.center_m.x, places.center_m.y, places.center_m.z,
            asked, losses);
}

}  // namespace sightline
