// Quality levels: the parts that a step leaves out when time is short. The level is an input of a step, like its
// settings, so the same level gives the same bits. Expensive parts with little effect on the result are left out first.
#pragma once

#include <cstdint>
#include <string>

#include "server/step/step.h"

namespace sightline {

// Level 0 leaves nothing out. Each further level leaves out what the level before does, and more:
//   1  the viewpoint search takes maps at half its resolution
//   2  half of the points of each target
//   3  three quarters of the points; half of the candidates
//   4  three quarters of the candidates; the viewpoint search at a quarter of its resolution, other maps at three
//   quarters of theirs 5  all but an eighth of the points and candidates; maps at half their resolution; the prediction
// Candidates are left out late, because a lattice of another spacing starts without a visibility history. The viewpoint
// search is never switched off, because the camera would then return to the client's shot.
inline constexpr int kLowestQualityLevel = 5;

// The settings of a step at `level`, [0, kLowestQualityLevel]. They are valid if `settings` are, and no value is above
// that of `settings`. Points become 0 only if they were 0.
StepSettings degrade(const StepSettings& settings, int level);

// True if `level` changes any of these settings.
bool degrades(const StepSettings& settings, int level);

// The changes of these settings at `level`, in words: "points 8 -> 4, search resolution 8 -> 4". Empty if nothing
// changes.
std::string describe_degradation(const StepSettings& settings, int level);

// Rough cost of a step at `level` relative to level 0, (0, 1]: a first estimate until the cost is measured.
double expected_cost(int level);

}  // namespace sightline
