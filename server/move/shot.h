// Shot: which of the surveyed places the camera should want (paper 6.2, coherence; 3.4, responsiveness and predictive power).
//
// A place is good when the targets are seen from it, and from beside it, so that it stays good when they turn. It is dear when
// it changes the shot that is, or departs from the one that was asked for: coherence.h says what a change costs.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "server/aggregate/survey.h"
#include "server/move/coherence.h"
#include "server/settings/move_settings.h"

namespace sightline {

// The camera `offset_m` from the targets' centre, not zero, looking at it, without roll: enough to compare shots with each other.
Pose pose_of_shot(const glm::dvec3& center_m, const glm::dvec3& offset_m);

// The place of the shot that was asked for when it is good enough (ViewpointSearchSettings::keep_shot_below), else the former one when that is,
// else the place of least cost; none when none is allowed. `allowed(offset_m)`: the limits of distance and elevation, and that the
// targets fit the picture. `asked` and `present`: the shot that the client asked for and the one that is, of these targets, all
// of them taken as seen; `asked_place` is most like the first. `former`: the place that was chosen before. The survey is of these
// targets, in this order.
std::optional<size_t> choose_shot(const Survey& survey, std::span<const TargetView> targets,
                                  const ShotState& asked, size_t asked_place, const ShotState& present,
                                  size_t former, const ViewpointSearchSettings& settings,
                                  const CoherenceSettings& coherence,
                                  const std::function<bool(const glm::dvec3& offset_m)>& allowed);

}  // namespace sightline
