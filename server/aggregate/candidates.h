// The candidates of one step: positions that the camera could take, and which targets each of them sees.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "server/aggregate/places.h"

namespace sightline {

// A structure of arrays with one entry a candidate, or none where a comment allows it. Memory is reused from step to
// step.
struct CandidateSet {
  PlaceList position_m;                   // world
  std::vector<uint32_t> visible_targets;  // bit i: enough of the sampled points of target i are seen in this step
  // The same after the filter over the last steps (paper 5). Empty without a filter.
  std::vector<uint32_t> filtered_targets;
  // Bit i: target i would be seen where it is predicted to be. Empty without a prediction.
  std::vector<uint32_t> ahead_targets;

  size_t size() const { return position_m.size(); }
  std::span<const uint32_t> filtered() const { return filtered_targets.empty() ? visible_targets : filtered_targets; }
  std::span<const uint32_t> ahead() const { return ahead_targets.empty() ? filtered() : ahead_targets; }
  void clear() { position_m.clear(), visible_targets.clear(), filtered_targets.clear(), ahead_targets.clear(); }
  // Adds a single candidate. Lists that are empty for want of a filter or prediction stay empty.
  void add(const glm::dvec3& p, uint32_t visible = 0) { position_m.push_back(p), visible_targets.push_back(visible); }
};

}  // namespace sightline
