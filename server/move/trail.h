// Trail: the way that the targets took, for a camera that has lost them. What they walked through is open, so the newest place of
// the trail that the camera can reach is a way back to them, round any number of corners.
#pragma once

#include <glm/glm.hpp>
#include <optional>
#include <vector>

#include "server/scene/clearance.h"

namespace sightline {

class Trail {
 public:
  static constexpr double kStepM = 0.25;  // between remembered places
  static constexpr double kJumpM = 3.0;   // farther in one step is a jump: the trail starts anew
  static constexpr size_t kPlaces = 100;  // 25 m

  // The targets' centre in this step.
  void pass(const glm::dvec3& center_m);
  void forget() { places_m_.clear(); }

  // The newest place within `reach_m` to which the body can go straight from `from_m`, `keep_off_m` or more from where the targets
  // are; the field must cover that. Tests at most kPlaces paths: to be called only when the targets are lost.
  std::optional<glm::dvec3> way_back(const ClearanceField& field, const glm::dvec3& from_m, double reach_m,
                                     double body_radius_m, double keep_off_m) const;

  const std::vector<glm::dvec3>& places_m() const { return places_m_; }  // oldest first

 private:
  std::vector<glm::dvec3> places_m_;
};

}  // namespace sightline
