#include "server/move/best_acceleration.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace sightline {
namespace {

// An acceleration is held until the last slice within this time, and at least until the first.
constexpr double kHoldS = 0.35;
// Then the camera drifts on for this time before the plan leads it elsewhere.
constexpr double kDriftS = 0.1;
// Differences of cost that are smaller than this hardly matter, in units of the cost of a plan.
constexpr double kTemperatureM = 0.17;
// The cost of (m/s)^2 of the difference from the targets' velocity, in units of the cost of a plan.
constexpr double kSpeedM = 0.02;
// The plan's own acceleration counts as this many others.
constexpr double kPlannedWeight = 10.0;
// The strengths tried in each direction, as shares of the limit.
constexpr std::array kStrengths = {0.3, 0.65, 1.0};

struct Flight {
  glm::dvec3 position_m, velocity_mps;
  double way_m = 0.0;
};

void fly(Flight& flight, const glm::dvec3& acceleration_mps2, double max_speed_mps, double time_s) {
  glm::dvec3 after_mps = flight.velocity_mps + acceleration_mps2 * time_s;
  if (const double speed_mps = glm::length(after_mps); speed_mps > max_speed_mps)
    after_mps *= max_speed_mps / speed_mps;
  const glm::dvec3 step_m = (flight.velocity_mps + after_mps) * (time_s / 2);
  flight.position_m += step_m, flight.velocity_mps = after_mps;
  flight.way_m += glm::length(step_m);
}

// In units of the cost of a plan; infinite if it leads out of the open cells or into a wall.
double cost_of(const FlightPlanner& planner, const FlightSettings& settings, const AccelerationInput& input,
               const glm::dvec3& acceleration_mps2) {
  Flight flight{input.position_m, input.velocity_mps};
  double sum = 0, passed_s = 0;
  size_t slice = 0;
  for (double at_s = input.first_slice_s; slice < planner.slice_count() && (slice == 0 || at_s <= kHoldS);
       ++slice, at_s += settings.slice_s) {
    fly(flight, acceleration_mps2, input.max_speed_mps, at_s - passed_s);
    passed_s = at_s;
    const double here = planner.cost_at(flight.position_m, slice, INFINITY);
    if (!std::isfinite(here)) return INFINITY;
    sum += here;
  }
  if (input.is_free && !input.is_free(flight.position_m)) return INFINITY;
  const double strength = glm::length(acceleration_mps2) / input.max_acceleration_mps2;
  const glm::dvec3 relative_mps = flight.velocity_mps - input.group_velocity_mps;
  return (sum + planner.cost_from(flight.position_m + flight.velocity_mps * kDriftS, slice, INFINITY)) /
             static_cast<double>(planner.slice_count()) +
         settings.route * flight.way_m + input.effort_m * strength * strength +
         kSpeedM * glm::dot(relative_mps, relative_mps);
}

}  // namespace

std::optional<glm::dvec3> best_acceleration_mps2(const FlightPlanner& planner, const FlightSettings& settings,
                                                 const AccelerationInput& input) {
  struct Tried {
    glm::dvec3 acceleration_mps2;
    double cost, weight;
  };
  std::array<Tried, 26 * kStrengths.size() + 2> tried;
  size_t count = 0;
  const auto attempt = [&](const glm::dvec3& acceleration_mps2, double weight) {
    tried[count++] = {acceleration_mps2, cost_of(planner, settings, input, acceleration_mps2), weight};
  };
  const double planned = glm::length(input.planned_mps2);
  attempt(input.planned_mps2 * (planned > input.max_acceleration_mps2 ? input.max_acceleration_mps2 / planned : 1.0),
          kPlannedWeight);
  attempt(glm::dvec3(0.0), 1.0);
  for (int k = 0; k < 27; ++k)  // towards the faces, edges and corners of a cube
    for (const double strength : kStrengths)
      if (k != 13)
        attempt(
            glm::normalize(glm::dvec3(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1)) * (strength * input.max_acceleration_mps2),
            1.0);
  double least = INFINITY;
  for (const Tried& one : tried) least = std::min(least, one.cost);
  if (!std::isfinite(least)) return std::nullopt;
  glm::dvec3 sum(0.0);
  double weights = 0;
  for (const Tried& one : tried) {
    const double weight = one.weight * std::exp((least - one.cost) / kTemperatureM);
    sum += weight * one.acceleration_mps2, weights += weight;
  }
  return sum / weights;
}

}  // namespace sightline
