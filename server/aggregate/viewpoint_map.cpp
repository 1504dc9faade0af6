#include "server/aggregate/viewpoint_map.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

namespace sightline {
namespace {

// From level to almost overhead, so that the camera can look over heads, hedges and pillars, and down between
// obstacles. The camera's greatest elevation is 1.4 by default.
constexpr std::array<double, ViewpointMap::kElevations> kElevationsRad = {0.05, 0.3, 0.55, 0.85, 1.15, 1.37};
constexpr std::array<double, ViewpointMap::kDistances> kDistanceShares = {0.4, 0.7, 1.0, ViewpointMap::kFarthestShare};

size_t place_at(size_t azimuth, size_t elevation, size_t distance) {
  return (azimuth % ViewpointMap::kAzimuths * ViewpointMap::kElevations + elevation) * ViewpointMap::kDistances +
         distance;
}

}  // namespace

ViewpointMap::ViewpointMap() {
  for (size_t azimuth = 0; azimuth < kAzimuths; ++azimuth)
    for (size_t elevation = 0; elevation < kElevations; ++elevation) {
      const double turn = 2 * std::numbers::pi * static_cast<double>(azimuth) / static_cast<double>(kAzimuths),
                   rise = kElevationsRad[elevation];
      directions_[azimuth * kElevations + elevation] = {std::cos(rise) * std::cos(turn), std::sin(rise),
                                                        std::cos(rise) * std::sin(turn)};
    }
}

void ViewpointMap::follow(std::span<const uint64_t> target_ids, double distance_m) {
  distance_m_ = distance_m;
  if (std::equal(ids_.begin(), ids_.end(), target_ids.begin(), target_ids.end())) return;
  std::vector<float> shares(target_ids.size() * kViewpoints, 1.0f);
  std::vector<double> known_s(target_ids.size(), 0.0);
  for (size_t i = 0; i < target_ids.size(); ++i) {
    const auto old = static_cast<size_t>(std::find(ids_.begin(), ids_.end(), target_ids[i]) - ids_.begin());
    if (old == ids_.size()) continue;
    const auto from = std::span<const float>(shares_).subspan(old * kViewpoints, kViewpoints);
    std::copy(from.begin(), from.end(), std::span<float>(shares).subspan(i * kViewpoints, kViewpoints).begin());
    known_s[i] = known_s_[old];
  }
  ids_.assign(target_ids.begin(), target_ids.end());
  shares_ = std::move(shares);
  known_s_ = std::move(known_s);
}

glm::dvec3 ViewpointMap::offset_m(size_t place) const {
  return distance_m_ * kDistanceShares[place % kDistances] * directions_[place / kDistances];
}

size_t ViewpointMap::nearest_viewpoint(const glm::dvec3& offset_m) const {
  const double length_m = glm::length(offset_m);
  double least = std::numeric_limits<double>::infinity();
  size_t nearest = 0;
  for (size_t place = 0; place < kViewpoints; ++place) {
    const glm::dvec3 at_m = this->offset_m(place);
    const double far_m = glm::length(at_m), cosine = glm::dot(at_m, offset_m) / (far_m * length_m);
    const double apart = std::acos(std::clamp(cosine, -1.0, 1.0)) + std::abs(std::log(far_m / length_m));
    if (apart < least) least = apart, nearest = place;
  }
  return nearest;
}

void ViewpointMap::learn(size_t target, std::span<const DepthMap> maps, const glm::dvec3& center_m,
                         double relative_bias, double since_s, double memory_s) {
  const auto newest = static_cast<float>(-std::expm1(-since_s / memory_s));
  known_s_[target] += since_s;
  places_m_.resize(kViewpoints);
  for (size_t place = 0; place < kViewpoints; ++place) places_m_[place] = center_m + offset_m(place);
  static_assert(kViewpoints <= kTilePlaces, "one tile holds them all");
  SightTile tile;
  look_up_.set_places(places_m_);
  look_up_.begin_maps(relative_bias);
  const size_t first_map = look_up_.add_maps(maps);
  look_up_.load_tile(0, tile);
  const std::span<const uint8_t> sights = look_up_.look(first_map, maps.size(), tile);
  const std::span<float> shares = std::span(shares_).subspan(target * kViewpoints, kViewpoints);
  for (size_t place = 0; place < kViewpoints; ++place) {
    if (sights[place] == kUnknownSight) continue;
    shares[place] += newest * ((sights[place] == kVisibleSight ? 1.0f : 0.0f) - shares[place]);
  }
}

float ViewpointMap::share_beside(size_t target, size_t place) const {
  const size_t distance = place % kDistances, elevation = place / kDistances % kElevations,
               azimuth = place / (kDistances * kElevations);
  float sum = share(target, place_at(azimuth + 1, elevation, distance)) +
              share(target, place_at(azimuth + kAzimuths - 1, elevation, distance));
  float count = 2;
  if (elevation > 0) sum += share(target, place_at(azimuth, elevation - 1, distance)), ++count;
  if (elevation + 1 < kElevations) sum += share(target, place_at(azimuth, elevation + 1, distance)), ++count;
  return sum / count;
}

double ViewpointMap::known_s() const {
  return known_s_.empty() ? 0.0 : *std::min_element(known_s_.begin(), known_s_.end());
}

}  // namespace sightline
