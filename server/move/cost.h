// Costs: what each strategy prefers among candidates that see the same (paper 3.4, 6.1, 6.2). Lower is better.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "server/aggregate/candidates.h"
#include "server/base/error.h"
#include "server/move/groups.h"

namespace sightline {

// Basic: the distance to the desired place, metres.
void basic_costs(std::span<const glm::dvec3> position_m, const glm::dvec3& desired_m,
                 std::vector<double>& cost);

// RobustMove as printed: the distance to the centre of the largest group, which is its deepest member; places outside that group
// come after all inside it. The same as Basic when there is no group.
void robust_costs(std::span<const glm::dvec3> position_m, const glm::dvec3& desired_m, const Groups& groups,
                  std::vector<double>& cost);

// How the blend weighs; not all weights 0. What goes wrong at the ends: with no shelter the camera hovers at the edge of a view and loses it at the
// targets' next step; with much of it, it wanders into the middle of free space and lets the shot go.
struct BlendSettings {
  double distance = 1.0;  // [0, 10]; of a metre from the desired place
  double shelter = 1.0;   // [0, 10]; of standing at the rim of a group instead of `full_depth_m` inside it
  double full_depth_m = 0.6;  // (0, 5]; deeper is not better
};
Status validate(const BlendSettings& settings);

// Near the desired place and sheltered at once. `spacing_m` is one grid step of the groups.
void blend_costs(std::span<const glm::dvec3> position_m, const glm::dvec3& desired_m, const Groups& groups,
                 double spacing_m, const BlendSettings& settings, std::vector<double>& cost);

}  // namespace sightline
