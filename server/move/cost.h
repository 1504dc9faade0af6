// The costs by which the paper's strategies order candidates (paper 3.4, 6.1, 6.2). Lower is better. They exist only to reproduce the
// paper; the default strategy plans ahead (flight_plan.h).
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "server/aggregate/candidates.h"
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

}  // namespace sightline
