#include "client/ceiling/guide.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace sightline {
namespace {

constexpr float kPictureParts = 200.0f, kToGoParts = 64.0f;

template <typename Part>
Part in_parts(float cost, float parts) {
  constexpr long kMost = std::numeric_limits<Part>::max();
  return static_cast<Part>(std::clamp(std::lround(cost * parts), 0l, kMost));
}

}  // namespace

Guide::Guide(const PlaceGrid& grid, size_t stages) : grid_(grid), stages_(stages) {}

void Guide::keep(size_t stage, std::span<const float> pictures, std::span<const float> to_go) {
  Stage& kept = stages_[stage];
  kept.least_to_go = *std::min_element(to_go.begin(), to_go.end());
  for (const float cost : pictures) kept.pictures.push_back(in_parts<uint8_t>(cost, kPictureParts));
  for (const float cost : to_go) kept.above.push_back(in_parts<uint16_t>(cost - kept.least_to_go, kToGoParts));
}

double Guide::picture(const glm::dvec3& point_m, size_t stage) const {
  const uint32_t place = place_near(point_m);
  if (place == kNoPlace) return kNoWayCost;
  return stage < stages_.size() ? static_cast<double>(stages_[stage].pictures[place] / kPictureParts) : 0.0;
}

double Guide::to_go(const glm::dvec3& point_m, size_t stage) const {
  const uint32_t place = place_near(point_m);
  if (place == kNoPlace) return kNoWayCost;
  if (stage >= stages_.size()) return 0.0;
  return static_cast<double>(stages_[stage].least_to_go + stages_[stage].above[place] / kToGoParts);
}

// The place of the point's cell; else the nearest place of a cell next to it.
uint32_t Guide::place_near(const glm::dvec3& point_m) const {
  const glm::ivec3 cell = grid_.cell_of(point_m);
  if (const uint32_t place = grid_.at(cell); place != kNoPlace) return place;
  uint32_t nearest = kNoPlace;
  double least_m = INFINITY;
  for (int k = 0; k < 27; ++k) {
    const uint32_t place = grid_.at(cell + glm::ivec3(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1));
    if (place == kNoPlace) continue;
    const double distance_m = glm::distance(grid_.place_m(place), point_m);
    if (distance_m < least_m) least_m = distance_m, nearest = place;
  }
  return nearest;
}

}  // namespace sightline
