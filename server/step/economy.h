// Economy: what a step leaves out when there is no time for all of it. A level is an input of a step like its settings:
// the same level gives the same bits. What costs most and is missed least goes first.
#pragma once

#include <cstdint>
#include <string>

#include "server/step/step.h"

namespace sightline {

// Level 0 leaves nothing out; each further one leaves out what the one before does, and more:
//   1  the turns that targets may take (MoveSettings::turn_probability): a guess, and a third of the guesses' maps each
//   2  half of the points of each target; the survey at half its resolution
//   3  three quarters of the points; half of the candidates
//   4  three quarters of the candidates; the survey at a quarter of its resolution, maps at three quarters of theirs
//   5  all but an eighth of points and candidates, maps at half their resolution, the prediction
// The candidates come late because a lattice of another spacing has to learn anew what was seen before. A survey is
// never left out: without one the camera goes back to the shot that it was asked for.
inline constexpr int kMaxEconomyLevel = 5;

// The settings of a step at `level`, [0, kMaxEconomyLevel]; valid when `settings` are, and never more than they ask
// for. Where the settings are at the least of a range already, so are those of every level. Points are never 0 unless
// they were.
StepSettings economise(const StepSettings& settings, int level);

// Whether `level` leaves anything out of a step with these settings.
bool economises(const StepSettings& settings, int level);

// What `level` changes of these settings, for people: "points 8 -> 4, survey resolution 8 -> 4"; empty when nothing.
std::string describe_economy(const StepSettings& settings, int level);

// About what a step costs at `level`, as a share of what it costs at level 0, (0, 1]: the first guess of who has not
// measured it.
double expected_cost(int level);

}  // namespace sightline
