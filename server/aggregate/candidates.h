// The candidates of one step: places where the camera could be, and which targets each sees.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

namespace sightline {

// Structure of arrays; all of one length. Memory is reused from step to step.
struct CandidateSet {
  std::vector<glm::dvec3> position_m;     // world
  std::vector<uint32_t> visible_targets;  // bit i: target i of the step is seen (its sampled point, this tick)

  size_t size() const { return position_m.size(); }
  void clear() { position_m.clear(), visible_targets.clear(); }
  void add(const glm::dvec3& p) { position_m.push_back(p), visible_targets.push_back(0); }
};

}  // namespace sightline
