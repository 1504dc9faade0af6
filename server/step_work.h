// The working set of one step, shared by its stages. Internal to step: nothing else includes it.
#pragma once

#include <cstdint>
#include <optional>

#include "server/step.h"

namespace sightline {

// The inputs, the memory, and the answer that grows stage by stage.
struct StepWork {
  StepMemory& memory;
  const StepInput& input;
  StepResult& result;
  double move_s = 0;     // for how long the camera moves
  uint32_t steered = 0;  // bit i: target i has a weight
  Lens lens;             // as it is now, zoom included
  std::optional<PairVolume> pair;
  size_t own_candidate = 0;  // index of the camera's own place among the candidates
};

void look_at_targets(StepWork& work);             // what is known of the targets, before the first stage
void bound(StepWork& work);                       // paper 3.1
Status sample(StepWork& work, Sampler& sampler);  // paper 3.2, 4
void aggregate(StepWork& work);                   // paper 3.3, 5
void move(StepWork& work);                        // paper 3.4, 6
void report_targets(StepWork& work);              // what the returned pose sees

// The place that the camera wants now.
glm::dvec3 desired_place(const StepWork& work);

// How much of target i is seen from the camera's own place, by the single-texel maps of its points, as if the camera stood at
// `place_m`, which is there or a step away.
struct OwnSight {
  uint32_t seen = 0, points = 0;
  uint32_t occluder = kNoOccluder;  // of most hidden points; of equals the first
  double share() const { return points > 0 ? static_cast<double>(seen) / points : 0.0; }
};
OwnSight own_sight(const StepWork& work, size_t target, const glm::dvec3& place_m);

}  // namespace sightline
