// The candidates of one step: places where the camera could be, and which targets each sees.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "server/aggregate/places.h"

namespace sightline {

// Structure of arrays, all as long as the places or empty where said. Memory is reused from step to step.
struct CandidateSet {
  PlaceList position_m;                   // world
  std::vector<uint32_t> visible_targets;  // bit i: target i is seen in this step: enough of its sampled points are
  // What the last steps together make of it (paper 5). Empty without a filter: the same.
  std::vector<uint32_t> filtered_targets;
  // Bit i: target i would be seen where it is predicted to be. Empty without a prediction: the same as with the filter.
  std::vector<uint32_t> ahead_targets;

  size_t size() const { return position_m.size(); }
  std::span<const uint32_t> filtered() const { return filtered_targets.empty() ? visible_targets : filtered_targets; }
  std::span<const uint32_t> ahead() const { return ahead_targets.empty() ? filtered() : ahead_targets; }
  void clear() {
    position_m.clear(), visible_targets.clear(), filtered_targets.clear(), ahead_targets.clear();
  }
  // A single place more; the lists that are empty then stay so.
  void add(const glm::dvec3& p, uint32_t visible = 0) { position_m.push_back(p), visible_targets.push_back(visible); }
};

}  // namespace sightline
