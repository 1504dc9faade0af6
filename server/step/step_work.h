// The working set of one step, shared by its stages. Internal to step: nothing else includes it.
#pragma once

#include "server/step/step.h"

namespace sightline {

void look_at_targets(StepWork& work);             // what is known of the targets, before the first stage
void bound(StepWork& work);                       // paper 3.1
void plan_sample(StepWork& work);                 // paper 3.2, 4: which maps to take
void aggregate(StepWork& work);                   // paper 3.3, 5
void move(StepWork& work);                        // paper 3.4, 6
void report_targets(StepWork& work);              // what the returned pose sees

// Where a map may end when no place that is looked up in it is farther from its eye.
inline double beyond_all_m(double farthest_m) { return 1.001 * farthest_m + 0.01; }

// Of the survey (step_survey.cpp): one target looks round, the places learn from it, the shot to want is chosen.
void plan_survey(StepWork& work);
void request_survey(StepWork& work);
void learn_survey(StepWork& work);

// Strategy kMinCost (step_goal.cpp): the goal by what is hidden, now and ahead, and by the way there; and the velocity to it.
bool expects_hidden(const StepWork& work);
HiddenWeights hidden_weights(const StepWork& work, double weight);
void begin_hidden(StepWork& work);   // before the maps are looked at
void expect_hidden(StepWork& work);  // after those of the targets where they are and where they are foretold
// Of the future against what is now, and the part of it that is foretold with all its points.
double weight_ahead(const StepWork& work);
double weight_foretold(const StepWork& work);
Choice choose_goal(StepWork& work, const glm::dvec3& desired_m);
glm::dvec3 velocity_to_goal(StepWork& work, Choice& choice);

// The targets' mean velocity, by weight.
glm::dvec3 group_velocity(const StepWork& work);
// Of the step's sampled points, as the composer takes them.
SampledPoints as_input(const StepWork& work, const Sampled& sampled);
// Nobody walks: what is seen now will be seen, but for what passes.
bool targets_stand(const StepWork& work);
// Lists memory.cells, and which candidates see all steered targets: memory.members.
void list_all_visible(StepWork& work);

// The place that the camera wants now.
glm::dvec3 desired_place(const StepWork& work);

// How far short of `place_m`, the camera's own place or a step away, the view that sight k's point has of it ends, metres. Not above 0
// when the point is seen from there.
double falls_short_m(const StepWork& work, uint32_t sight, const glm::dvec3& place_m);

// How much of target i is seen from the camera's own place, by its sights, as if the camera stood at `place_m`.
struct OwnSight {
  uint32_t seen = 0, points = 0;
  uint32_t occluder = kNoOccluder;  // of most hidden points; of equals the first
  double share() const { return points > 0 ? static_cast<double>(seen) / points : 0.0; }
};
OwnSight own_sight(const StepWork& work, size_t target, const glm::dvec3& place_m);

}  // namespace sightline
