// Two people who wander through a level, one behind the other, as a scenario that a camera can be tried in.
#pragma once

#include <span>

#include "client/check/walkable.h"
#include "client/scenario/scenario.h"

namespace sightline {

inline constexpr double kWalkS = 40.0;  // length of the scenario

// The level with the two as targets and a camera behind them; its own roles stay out of it. They walk at 1.5 m/s, 1.8 m
// apart, from one place drawn by lot to the next. The same seed gives the same walk. kFailedPrecondition where there
// are too few places to walk.
Result<Scenario> wandering_in(const Level& level, std::span<const StandingPlace> places, uint64_t seed);

}  // namespace sightline
