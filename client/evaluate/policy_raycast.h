// What one would write first: a ray from every candidate place to every target's centre, and the nearest
// place that sees all. Same candidates, same choice, same motion limits and body as Sightline's Basic; only
// what is known of visibility differs: exact, of one point a target, at a cost of candidates x targets rays.
#pragma once

#include "client/evaluate/policy.h"
#include "server/aggregate/lattice.h"
#include "server/move/body.h"
#include "server/move/choose.h"
#include "server/move/framing.h"
#include "server/move/motion.h"
#include "server/scene/clearance.h"
#include "server/step/step.h"

namespace sightline {

// Sets bit i of visible_targets of every candidate from which the straight line to the aim point of
// targets[i] meets no occluder but that target; clears the others. `occluders` must have taken in `mirror`.
void cast_visibility(const EmbreeScene& occluders, const SceneMirror& mirror, std::span<const Target> targets,
                     CandidateSet& candidates);

class RaycastPolicy : public CameraPolicy {
 public:
  RaycastPolicy(const PolicySite& site, std::unique_ptr<ScenarioWorld> world);
  Result<PolicyStep> next(double time_s, double dt_s) override;

 private:
  void look_at_targets();
  void list_candidates(const Bound& bound, const glm::dvec3& desired_m);
  Choice choose(const Bound& bound, const glm::dvec3& desired_m);
  void travel(const Choice& choice, double dt_s);

  const PolicySite site_;
  const StepSettings settings_;
  const Lens lens_;
  const std::unique_ptr<ScenarioWorld> world_;
  const glm::dvec3 offset_m_;
  std::vector<TrackedTarget> views_;
  glm::dvec3 center_velocity_mps_{0.0};
  CameraState camera_;
  TurnState turn_;
  double horizon_s_;
  Lattice lattice_;
  CandidateSet candidates_;
  ClearanceField colliders_;
  ChoiceScratch scratch_;
};

}  // namespace sightline
