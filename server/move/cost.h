// Costs: what each strategy prefers among candidates that see the same (paper 3.4, 6.1, 6.2). Lower is better.
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

// Basic: the distance to the desired place, metres.
void basic_costs(const PlaceView& places, const glm::dvec3& desired_m,
                 std::vector<double>& cost);

// RobustMove: the distance to the place of the largest group that is farthest from everything hidden, of equal ones the nearest to
// the desired place; places outside that group come after all inside it. The same as Basic when there is no group.
// `shelter_squared`: see measure_shelter.
void robust_costs(std::span<const glm::dvec3> position_m, const glm::dvec3& desired_m, const Groups& groups,
                  std::span<const uint32_t> shelter_squared, std::vector<double>& cost);

// What the costs are computed from; spans as long as the candidates. What it refers to must outlive the CandidateCosts.
struct CostInput {
  std::span<const glm::dvec3> position_m;
  std::span<const double> hidden;  // [0, 1]: expected hidden share of the targets
  double spacing_m = 1.0;          // of the grid of which depths are told
  glm::dvec3 desired_m{0.0};
  std::optional<glm::dvec3> former_goal_m;
};

// What one candidate costs, metres: the sum of the weighed terms.
class CandidateCosts {
 public:
  CandidateCosts(const CostInput& input, const CostWeights& settings) : input_(input), settings_(settings) {}

  // `route_m`: of the way there, finite. `depth_squared`: grid steps squared, as Groups has them. With a longer way, or less depth,
  // it is never less, not in the last bit.
  double of(size_t candidate, double route_m, uint32_t depth_squared) const;
  // No more than `of` with any depth, and quick.
  double least_of(size_t candidate, double route_m) const;
  // So many grid steps deep or deeper is all the same.
  uint32_t full_depth_steps() const;

 private:
  double missed_and_far(size_t candidate) const;

  const CostInput input_;
  const CostWeights settings_;
};

}  // namespace sightline
