// The costs by which each strategy orders candidates (paper 3.4, 6.1, 6.2). Lower is better. Basic and RobustMove exist only to
// reproduce the paper; the default strategy uses CandidateCosts.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <optional>
#include <span>
#include <vector>

#include "server/aggregate/candidates.h"
#include "server/move/groups.h"
#include "server/settings/move_settings.h"

namespace sightline {

// Basic: the distance to the desired position, metres.
void basic_costs(const PlaceView& places, const glm::dvec3& desired_m,
                 std::vector<double>& cost);

// RobustMove: the distance to that candidate of the largest group which is farthest from everything hidden; of equal ones, the one nearest
// to the desired position. Candidates outside the group come after all inside it. The same as Basic when there is no group.
// `edge_distance_squared`: see measure_edge_distances.
void robust_costs(std::span<const glm::dvec3> position_m, const glm::dvec3& desired_m, const Groups& groups,
                  std::span<const uint32_t> edge_distance_squared, std::vector<double>& cost);

// The input of CandidateCosts, which must not outlive it. Spans have one entry a candidate.
struct CostInput {
  std::span<const glm::dvec3> position_m;
  std::span<const double> hidden;  // [0, 1]: expected hidden share of the targets
  double spacing_m = 1.0;          // of the lattice; the unit of edge depths
  glm::dvec3 desired_m{0.0};
  std::optional<glm::dvec3> former_goal_m;
};

// The cost of one candidate, metres: the sum of the weighted terms.
class CandidateCosts {
 public:
  CandidateCosts(const CostInput& input, const CostWeights& settings) : input_(input), settings_(settings) {}

  // `route_m`: cost of the route to the candidate, finite. `depth_squared`: see EdgeDepths::squared. The cost never falls with a longer
  // route or less depth, not even by rounding.
  double of(size_t candidate, double route_m, uint32_t depth_squared) const;
  // A lower bound of `of` for every depth. Cheap.
  double least_of(size_t candidate, double route_m) const;
  // The edge depth, in lattice steps, from which on more depth changes nothing.
  uint32_t full_depth_steps() const;

 private:
  double missed_and_far(size_t candidate) const;

  const CostInput input_;
  const CostWeights settings_;
};

}  // namespace sightline
