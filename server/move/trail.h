// The path that the targets took, for a camera that has lost them. The space that the targets walked through is open.
// The newest point of the path that the camera can reach therefore leads back to them, round any number of corners.
#pragma once

#include <glm/glm.hpp>
#include <optional>
#include <vector>

#include "server/scene/clearance.h"

namespace sightline {

class Trail {
 public:
  static constexpr double kStepM = 0.5;     // between remembered points
  static constexpr double kJumpM = 3.0;     // moving farther in one step is a jump, after which a new trail begins
  static constexpr size_t kPlaces = 1000;   // points remembered: 500 m
  static constexpr size_t kMostWays = 100;  // paths that way_back tests at most, so that a step stays short

  // Adds the targets' centre of this step.
  void pass(const glm::dvec3& center_m);
  void forget() { places_m_.clear(); }

  // The newest point within `reach_m` of `from_m` that is `keep_off_m` or more from the targets and to which the body
  // can go straight. The field must cover that reach. Tests the kMostWays newest points within reach, so call it only
  // when the targets are lost.
  std::optional<glm::dvec3> way_back(const ClearanceField& field, const glm::dvec3& from_m, double reach_m,
                                     double body_radius_m, double keep_off_m) const;

  const std::vector<glm::dvec3>& places_m() const { return places_m_; }  // oldest first

 private:
  friend struct StateFields;  // lists its fields, to write and read them as bytes (server/session/state_fields.h)
  std::vector<glm::dvec3> places_m_;
};

}  // namespace sightline
