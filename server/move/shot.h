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
#include "server/settings/move_settings.h"

namespace sightline {

// The pose at `offset_m` (not zero) from the targets' centre, looking at it without roll: good enough to compare shots.
Pose pose_of_shot(const glm::dvec3& center_m, const glm::dvec3& offset_m);

// The hidden share of the targets, [0, 1]: the mean of that from a viewpoint and that from those beside it. It is taken of the required targets
// first, and of all targets alike; the greater one counts.
double hidden_round_about(const ViewpointMap& viewpoints, std::span<const TrackedTarget> targets, size_t place);

// The viewpoint that the camera should go to. It is the asked one if at most `take_asked_below` is hidden round about, else the
// former one if that holds for settings.keep_shot_below, else the one of least cost. Empty when none is allowed.
//   viewpoints:  of these targets, in this order.
//   asked:       the shot that the client asked for, with all targets taken as seen; `asked_place` is the viewpoint nearest to it.
//   present:     the present shot, with all targets taken as seen.
//   former:      the viewpoint that was chosen before.
//   allowed:     true if an offset from the centre keeps the limits of distance and elevation, and the targets fit the picture.
std::optional<size_t> choose_shot(const ViewpointMap& viewpoints, std::span<const TrackedTarget> targets,
                                  const ShotState& asked, size_t asked_place, const ShotState& present,
                                  size_t former, double take_asked_below, const ViewpointSearchSettings& settings,
                                  const CoherenceSettings& coherence,
                                  const std::function<bool(const glm::dvec3& offset_m)>& allowed);

}  // namespace sightline
