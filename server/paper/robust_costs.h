// The costs by which the strategy RobustMove orders candidates (paper 3.4, 6.1). Lower is better.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "server/aggregate/candidates.h"
#include "server/paper/groups.h"

namespace sightline {

// Basic: the distance to the desired position, metres.
void basic_costs(const PlaceView& places, const glm::dvec3& desired_m, std::vector<double>& cost);

// RobustMove: the distance to that candidate of the largest group which is farthest from everything hidden; of equal
// ones, the one nearest to the desired position. Candidates outside the group come after all inside it. The same as
// Basic when there is no group. `edge_distance_squared`: see measure_edge_distances.
void robust_costs(std::span<const glm::dvec3> position_m, const glm::dvec3& desired_m, const Groups& groups,
                  std::span<const uint32_t> edge_distance_squared, std::vector<double>& cost);

// The mean of the positions of the largest group, which must exist.
glm::dvec3 center_of_largest_m(std::span<const glm::dvec3> position_m, const Groups& groups);
// RobustMove as printed: the distance to that mean. Candidates outside the group come after all inside it. The same as
// Basic when there is no group.
void center_costs(std::span<const glm::dvec3> position_m, const glm::dvec3& desired_m, const Groups& groups,
                  std::vector<double>& cost);

}  // namespace sightline
