// An evaluation as pictures (SVG text). Equal input gives equal bytes.
#pragma once

#include <span>
#include <string>

#include "client/evaluate/evaluation.h"
#include "client/evaluate/evaluation_tables.h"

namespace sightline {

// The least visible share of any target over time, a strip for each of `runs`, which are of one scene case.
std::string plot_shares(std::span<const RunRecord> runs);

// How far the camera is from where it started, over time, a strip for each of `runs`, which are of one scene case; all strips
// have the same scale.
std::string plot_offsets(std::span<const RunRecord> runs);

// From above: walls and movers cut at the targets' height, the targets' ways dashed, and the cameras' of
// `runs`, which are of the plan's scene case. +X to the right, +Z down.
std::string plot_paths(const ScenePlan& plan, std::span<const RunRecord> runs);

// One figure: a bar for every scene and policy, the mean over seeds.
std::string plot_bars(const Figure& figure, std::span<const Group> groups);

}  // namespace sightline
