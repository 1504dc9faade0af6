// The cost of changing the shot (paper 6.2 and 3.4), with the weights that the paper names: responsiveness, coherence and predictive
// power.
//
// A shot is what the viewer sees: which targets, from which side, how high, how far away, and where in the picture. Each of the five has
// a term, which is zero while nothing changes and grows with its own change. All terms are ratios or angles, so scaling the whole scene
// changes none of them. The coherence cost is their weighted mean, so only the ratios of the weights matter.
//
// The terms are independent where geometry allows it. Turning about the vertical through the targets' centre changes the view angle
// alone. Going straight back at the centre's height changes the distance alone. Turning the camera in place changes the screen alone.
// Going up at a constant distance changes both the height and the view angle.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "server/base/camera.h"
#include "server/base/transform.h"
#include "server/scene/target.h"
#include "server/settings/move_settings.h"

namespace sightline {

// The shot that is to be kept. Directions and shares have one entry a target.
struct ShotState {
  glm::dvec3 from_center_m{0.0};      // camera relative to the targets' weighted centre
  std::vector<glm::dvec3> direction;  // camera frame, unit; zero for a target at the lens
  std::vector<float> seen_share;      // [0, 1]
  double vertical_fov_rad = 0.0;
};
// Sets `shot` to the shot of these targets from this pose. At least one target must be steered; seen_share has one entry a target.
// Reuses memory.
void capture_shot(const Pose& world_from_camera, const Lens& lens, std::span<const TrackedTarget> targets,
                  std::span<const float> seen_share, ShotState& shot);

// A position that the camera could take.
struct ShotCandidate {
  Pose world_from_camera;             // looking where the camera would look from there
  std::span<const float> seen_share;  // per target, [0, 1]: filtered share, or 0 and 1 (see shares_from_mask)
  double depth_share = 1.0;           // [0, 1]: depth inside the visible region over the greatest depth; 1 when unknown
  double hidden_ahead = 0.0;  // [0, 1]: hidden_share of the predicted targets; 0 where none is predicted
};
// share[i] = bit i of the mask.
void shares_from_mask(uint32_t visible_targets, std::span<float> share);

// Each term is >= 0, and 0 for the present shot. Means are over the steered targets only: of visibility by `sight_weight`, else by weight.
struct CoherenceTerms {
  double visibility = 0;  // [0, 1]: mean loss of seen share; seeing more costs nothing
  double view_angle =
      0;                // [0, pi]: between the directions to the camera from the targets' centre then and now
  double height = 0;    // change of height over the centre, by the distance from it now
  double distance = 0;  // |ln(distance then / now)|: twice as far costs as much as half as far
  double screen =
      0;  // mean turn of the targets' directions in the camera frame, by half the vertical field of view
};
// `targets` are in the order in which they were captured. They may have moved since, for the shot is kept relative to them.
CoherenceTerms coherence_terms(const ShotCandidate& candidate, const ShotState& now,
                               std::span<const TrackedTarget> targets);

// The weighted mean of the terms. >= 0, not bounded above.
double coherence_cost(const ShotCandidate& candidate, const ShotState& now,
                      std::span<const TrackedTarget> targets, const CoherenceSettings& settings);

// The share of the targets that is not seen, [0, 1]; 0 when none is steered. Targets count by `sight_weight`: no weight of an
// optional target makes up for a required one.
double hidden_share(std::span<const TrackedTarget> targets, std::span<const float> seen_share);
// The same, with required and optional targets alike by their weights.
double hidden_share_by_weight(std::span<const TrackedTarget> targets, std::span<const float> seen_share);

// The whole cost of a candidate, [0, 1]:
//   r ((1 - p) hidden now + p risk) + (1 - r) c / (1 + c),   risk = 1 - depth_share (1 - hidden_ahead).
// r is the responsiveness, p the predictive power and c the coherence cost.
// The risk is the chance to be hidden, if depth is taken for the chance that the position stays free.
double shot_cost(const ShotCandidate& candidate, const ShotState& now, std::span<const TrackedTarget> targets,
                 const CoherenceSettings& settings);
// The first term of shot_cost, which is a lower bound of it for every present shot. The pose is not read.
double unseen_cost(const ShotCandidate& candidate, std::span<const TrackedTarget> targets,
                   const CoherenceSettings& settings);

}  // namespace sightline
