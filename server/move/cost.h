// The costs by which each strategy orders candidates (paper 3.4, 6.1, 6.2). Lower is better. Basic and RobustMove exist only to
// reproduce the paper; the default strategy uses BlendCosts.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <optional>
#include <span>
#include <vector>

#include "server/aggregate/candidates.h"
#include "server/base/error.h"
#include "server/move/groups.h"

namespace sightline {

// Basic: the distance to the desired position, metres.
void basic_costs(const PlaceView& places, const glm::dvec3& desired_m,
                 std::vector<double>& cost);

// RobustMove: the distance to that candidate of the largest group which is farthest from everything hidden; of equal ones, the one nearest
// to the desired position. Candidates outside the group come after all inside it. The same as Basic when there is no group.
// `edge_distance_squared`: see measure_edge_distances.
void robust_costs(std::span<const glm::dvec3> position_m, const glm::dvec3& desired_m, const Groups& groups,
                  std::span<const uint32_t> edge_distance_squared, std::vector<double>& cost);

// How the blend weighs; all in metres of the camera's way, not all weights 0. What goes wrong at the ends: with little for what is
// hidden the camera keeps its shot of a wall, with much it runs at every leaf; with no shelter it hovers at the edge of a view
// and loses it at the targets' next step, with much it wanders into the middle of free space and lets the shot go.
struct BlendSettings {
  double hidden = 80.0;  // [0, 1000]; what seeing all targets instead of none is worth
  double tolerance =
      0.05;  // [0, 1]; a hidden share up to this does not count. 0: the camera is never at rest; 1: nothing counts
  double distance = 1.0;  // [0, 10]; of a metre from the desired place
  double shelter = 1.0;   // [0, 10]; of standing at the rim of a group instead of `full_depth_m` inside it
  double full_depth_m = 0.6;  // (0, 5]; deeper is not better
  double route = 0.3;         // [0, 10]; of a metre of the way there
  double exposure = 5.0;      // [0, 100]; how much more a metre costs on which nothing is seen
  double steadiness =
      0.0;  // [0, 10]; of a goal a metre or more from the former one: 0: it flits between equals
};
Status validate(const BlendSettings& settings);

// The input of BlendCosts, which must not outlive it. Spans have one entry a candidate.
struct BlendInput {
  std::span<const glm::dvec3> position_m;
  std::span<const double> hidden;  // [0, 1]: expected hidden share of the targets
  double spacing_m = 1.0;          // of the lattice; the unit of edge depths
  glm::dvec3 desired_m{0.0};
  std::optional<glm::dvec3> former_goal_m;
};

// The cost of one candidate, metres: the sum of the weighted terms.
class BlendCosts {
 public:
  BlendCosts(const BlendInput& input, const BlendSettings& settings) : input_(input), settings_(settings) {}

  // `route_m`: cost of the route to the candidate, finite. `depth_squared`: see EdgeDepths::squared. The cost never falls with a longer
  // route or less depth, not even by rounding.
  double of(size_t candidate, double route_m, uint32_t depth_squared) const;
  // A lower bound of `of` for every depth. Cheap.
  double least_of(size_t candidate, double route_m) const;
  // The edge depth, in lattice steps, from which on more depth changes nothing.
  uint32_t full_depth_steps() const;

 private:
  double missed_and_far(size_t candidate) const;

  const BlendInput input_;
  const BlendSettings settings_;
};

}  // namespace sightline
