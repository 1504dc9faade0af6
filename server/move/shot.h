// Chooses the shot among the viewpoints round the targets (paper 6.2, coherence; 3.4, responsiveness and predictive power).
//
// A viewpoint is good when the targets are seen from it and from its neighbours, so that it stays good when they turn. It costs more the
// more it changes the present shot or departs from the shot that the client asked for (see coherence.h).
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "server/aggregate/viewpoint_map.h"
#include "server/move/coherence.h"

namespace sightline {

struct SurveySettings {
  bool enabled = false;   // off: the camera wants the place that it was asked for, seen or not
  double memory_s = 0.7;  // (0, 10]; time constant of what was seen. Short: it chases every gap; long: late
  int resolution = 8;     // texels a side of each face, [2, 32]
  double content =
      0.15;  // [0, 1]; while the targets stand, a shot is kept from which and from beside which no more than
  // this share of them is hidden, in the mean. 0: the camera is never at rest; 1: it never looks for another shot
  double hold = 0.02;  // [0, 1]; else a new shot must be this much better, of the shot cost in [0, 1]
};
Status validate(const SurveySettings& settings);

// The pose at `offset_m` (not zero) from the targets' centre, looking at it without roll: good enough to compare shots.
Pose pose_of_shot(const glm::dvec3& center_m, const glm::dvec3& offset_m);

// The viewpoint that the camera should go to. It is the asked one if that is good enough, else the former one if that is, else the one of
// least cost. Empty when none is allowed.
//   viewpoints:  of these targets, in this order.
//   asked:       the shot that the client asked for, with all targets taken as seen; `asked_place` is the viewpoint nearest to it.
//   present:     the present shot, with all targets taken as seen.
//   former:      the viewpoint that was chosen before.
//   allowed:     true if an offset from the centre keeps the limits of distance and elevation, and the targets fit the picture.
std::optional<size_t> choose_shot(const ViewpointMap& viewpoints, std::span<const TrackedTarget> targets,
                                  const ShotState& asked, size_t asked_place, const ShotState& present,
                                  size_t former, const SurveySettings& settings,
                                  const CoherenceSettings& coherence,
                                  const std::function<bool(const glm::dvec3& offset_m)>& allowed);

}  // namespace sightline
