// The candidates of one step: places where the camera could be, and which targets each sees.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

namespace sightline {

// Structure of arrays; all of one length. Memory is reused from step to step.
struct CandidateSet {
  std::vector<glm::dvec3> position_m;  // world
  std::vector<uint32_t>
      visible_targets;  // bit i: target i is seen in this step: enough of its sampled points are
  std::vector<uint32_t>
      filtered_targets;  // what the last steps together make of it (paper 5); the same without a filter
  std::vector<uint32_t> ahead_targets;  // bit i: target i would be seen where it is predicted to be

  size_t size() const { return position_m.size(); }
  void clear() {
    position_m.clear(), visible_targets.clear(), filtered_targets.clear(), ahead_targets.clear();
  }
  void add(const glm::dvec3& p, uint32_t visible = 0) {
    position_m.push_back(p), visible_targets.push_back(visible);
    filtered_targets.push_back(visible), ahead_targets.push_back(visible);
  }
};

}  // namespace sightline
