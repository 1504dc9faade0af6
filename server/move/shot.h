// Chooses the shot among the viewpoints round the targets (paper 6.2, coherence; 3.4, predictive power).
//
// A viewpoint is good when the targets are seen from it and from its neighbours, so that it stays good when they turn.
// It costs what its picture lacks of the worth of the asked shot (picture_worth.h), and something for the change of the
// present shot.
#pragma once

#include <functional>
#include <optional>
#include <span>

#include "server/aggregate/viewpoint_map.h"
#include "server/move/picture_worth.h"
#include "server/scene/target.h"
#include "server/settings/move_settings.h"

namespace sightline {

// The hidden share of the targets, [0, 1]: the mean of that from a viewpoint and that from those beside it. It is taken
// of the required targets first, and of all targets alike; the greater one counts.
double hidden_round_about(const ViewpointMap& viewpoints, std::span<const TrackedTarget> targets, size_t place);

struct ShotWish {
  glm::dvec3 asked_m{0.0};     // the client's shot: offset from the targets' centre to the camera, world axes; not zero
  glm::dvec3 present_m{0.0};   // that of the camera as it is; not zero
  glm::dvec3 subjects_m{0.0};  // from the targets' centre to the point from which side, height and size are measured
  double weight = 1.0;         // factor of MoveSettings::keep_shot
  double tolerance = 1.0;      // how wide the free bands are (picture_worth.h)
  size_t asked_place = 0;      // the viewpoint that is nearest to the client's shot
  size_t former_place = 0;     // the viewpoint that was chosen before
  double take_asked_below = 0.0;  // hidden share round about
};

// The viewpoint that the camera should go to. It is the asked one if at most `take_asked_below` is hidden round about,
// else the former one if that holds for viewpoint_search.keep_shot_below, else the one of least cost. Empty when none
// is allowed.
//   viewpoints:  of these targets, in this order.
//   allowed:     true if an offset from the centre keeps the limits of distance and elevation, and the targets fit the
//   picture.
std::optional<size_t> choose_shot(const ViewpointMap& viewpoints, std::span<const TrackedTarget> targets,
                                  const ShotWish& wish, const MoveSettings& settings,
                                  const std::function<bool(const glm::dvec3& offset_m)>& allowed);

}  // namespace sightline
