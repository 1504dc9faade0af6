// Coherence: what it costs to change the shot (paper 6.2 and 3.4), and the weights that the paper asks for:
// responsiveness, coherence and predictive power.
//
// A shot is what the viewer sees: which targets, from which side, how high, how far, and where in the
// picture. Each of the five has a term that is zero when nothing changes and grows with its own change. All
// terms are ratios or angles: scaling the whole scene (places of camera and targets alike) changes none of
// them. The coherence cost is their weighted mean, so that the weights matter only relative to each other.
//
// Some terms cannot be told apart by geometry: seen from the targets' centre, going up at one distance
// changes the view angle too. Where they can, they are independent: turning about the vertical through the
// centre changes the angle alone, going straight back at the centre's height the distance alone, turning the
// camera on its place the screen alone.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "server/base/camera.h"
#include "server/base/transform.h"
#include "server/move/target_view.h"
#include "server/settings/move_settings.h"

namespace sightline {

// The shot that is to be kept, and the memory of its targets. Directions and shares run parallel to the
// targets.
struct ShotState {
  glm::dvec3 from_center_m{0.0};      // camera relative to the targets' weighted centre
  std::vector<glm::dvec3> direction;  // camera frame, unit; zero for a target at the lens
  std::vector<float> seen_share;      // [0, 1]
  double vertical_fov_rad = 0.0;
};
// Takes the shot of these targets from this pose. At least one target is steered; seen_share is as long as
// targets. Reuses memory.
void capture_shot(const Pose& world_from_camera, const Lens& lens, std::span<const TargetView> targets,
                  std::span<const float> seen_share, ShotState& shot);

// A place that the camera could take.
struct ShotCandidate {
  Pose world_from_camera;             // with the aim that it would have there
  std::span<const float> seen_share;  // per target, [0, 1]: filtered share, or 0 and 1 (see shares_from_mask)
  double depth_share = 1.0;           // [0, 1]: Groups::depth_share; 1 where depth is not known
  double hidden_ahead = 0.0;  // [0, 1]: hidden_share of the predicted targets; 0 where none is predicted
};
// share[i] = bit i of the mask.
void shares_from_mask(uint32_t visible_targets, std::span<float> share);

// Each is >= 0 and 0 for the shot as it is. Means are over steered targets only: of what is seen by `sight_weight`, else by weight.
struct CoherenceTerms {
  double visibility = 0;  // [0, 1]: mean loss of seen share; seeing more costs nothing
  double view_angle =
      0;                // [0, pi]: between the directions to the camera from the targets' centre then and now
  double height = 0;    // change of height over the centre, by the distance from it now
  double distance = 0;  // |ln(distance then / now)|: twice as far costs as much as half as far
  double screen =
      0;  // mean turn of the targets' directions in the camera frame, by half the vertical field of view
};
// `targets` are in the order of the captured ones and may have moved since: the shot is kept relative to
// them.
CoherenceTerms coherence_terms(const ShotCandidate& candidate, const ShotState& now,
                               std::span<const TargetView> targets);

// The weighted mean of the terms. >= 0, not bounded above.
double coherence_cost(const ShotCandidate& candidate, const ShotState& now,
                      std::span<const TargetView> targets, const CoherenceSettings& settings);

// The share of the targets that is not seen, [0, 1]; 0 when none is steered. Targets count by `sight_weight`: no weight of an
// optional target makes up for a required one.
double hidden_share(std::span<const TargetView> targets, std::span<const float> seen_share);
// The same, with required and optional targets alike by their weights.
double hidden_share_by_weight(std::span<const TargetView> targets, std::span<const float> seen_share);

// The whole cost of a candidate, [0, 1], with r and p for responsiveness and predictive power:
//   r ((1 - p) hidden now + p risk) + (1 - r) c / (1 + c),   risk = 1 - depth_share (1 - hidden_ahead),   c =
//   coherence cost.
// Risk is the chance to be hidden if depth is taken for the chance that the place stays free.
double shot_cost(const ShotCandidate& candidate, const ShotState& now, std::span<const TargetView> targets,
                 const CoherenceSettings& settings);
// Its first term, whatever the shot is now: no shot_cost of the candidate is less. The pose is not read.
double unseen_cost(const ShotCandidate& candidate, std::span<const TargetView> targets,
                   const CoherenceSettings& settings);

}  // namespace sightline
