#include "server/move/trail.h"

#include "server/move/body.h"

namespace sightline {

void Trail::pass(const glm::dvec3& center_m) {
  if (!places_m_.empty()) {
    const double gone = glm::distance(places_m_.back(), center_m);
    if (gone < kStepM) return;
    if (gone > kJumpM) places_m_.clear();
  }
  if (places_m_.size() == kPlaces) places_m_.erase(places_m_.begin());
  places_m_.reserve(kPlaces);  // at once, so that no later step allocates
  places_m_.push_back(center_m);
}

std::optional<glm::dvec3> Trail::way_back(const ClearanceField& field, const glm::dvec3& from_m, double reach_m,
                                          double body_radius_m, double keep_off_m) const {
  StraightWays ways(field, from_m, body_radius_m);
  size_t tested = 0;
  for (auto place = places_m_.rbegin(); place != places_m_.rend(); ++place) {
    if (glm::distance(*place, places_m_.back()) < keep_off_m || glm::distance(*place, from_m) > reach_m) continue;
    if (ways.is_free(*place)) return *place;
    if (++tested == kMostWays) break;
  }
  return std::nullopt;
}

}  // namespace sightline
