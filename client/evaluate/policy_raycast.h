// The simplest occlusion-aware camera: it traces a ray from every candidate to every target's centre and takes the
// nearest candidate that sees all targets. Candidates, choice, motion limits and body are those of Sightline's Basic
// strategy. Only visibility differs: it is exact for one point of each target, and costs candidates x targets rays.
#pragma once

#include "client/evaluate/policy.h"
#include "server/aggregate/lattice.h"
#include "server/move/body.h"
#include "server/move/framing.h"
#include "server/move/motion.h"
#include "server/paper/choose_place.h"
#include "server/scene/clearance.h"
#include "server/step/step.h"

namespace sightline {

// Sets bit i of a candidate's visible_targets when the straight line to the aim point of targets[i] meets no occluder
// other than that target, and clears it otherwise. `occluders` must have taken in `mirror`.
void trace_visibility(const EmbreeScene& occluders, const SceneMirror& mirror, std::span<const Target> targets,
                      CandidateSet& candidates);

class RaycastPolicy : public CameraPolicy {
 public:
  RaycastPolicy(const PolicySite& site, std::unique_ptr<ScenarioWorld> world);
  Result<PolicyStep> next(double time_s, double dt_s) override;

 private:
  void update_views();
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
