// Quality levels: what a step leaves out when there is no time for all of it. The level is an input of a step, like its settings: the
// same level gives the same bits. What costs most and is missed least is left out first.
#pragma once

#include <cstdint>
#include <string>

#include "server/step/step.h"

namespace sightline {

// Level 0 leaves nothing out. Each further level leaves out what the level before does, and more:
//   1  the turns that targets may take (MoveSettings::turn_probability): they are guesses, and cost a third of the maps of guesses
//   2  half of the points of each target; the viewpoint search takes maps at half its resolution
//   3  three quarters of the points; half of the candidates
//   4  three quarters of the candidates; the viewpoint search at a quarter of its resolution, other maps at three quarters of theirs
//   5  all but an eighth of the points and candidates; maps at half their resolution; the prediction
// Candidates are left out late, because a lattice of another spacing has to learn anew what was seen before. The viewpoint search
// always goes on: without it the camera goes back to the shot that the client gave.
inline constexpr int kLowestQualityLevel = 5;

// The settings of a step at `level`, [0, kLowestQualityLevel]. They are valid when `settings` are, and never more than `settings` ask
// for. Points are never 0 unless they were.
StepSettings degrade(const StepSettings& settings, int level);

// Whether `level` changes any of these settings.
bool degrades(const StepSettings& settings, int level);

// What `level` changes of these settings, in words: "points 8 -> 4, viewpoint resolution 8 -> 4"; empty when nothing.
std::string describe_degradation(const StepSettings& settings, int level);

// About what a step costs at `level`, as a share of what it costs at level 0, (0, 1]: a first guess, until it has been measured.
double expected_cost(int level);

}  // namespace sightline
