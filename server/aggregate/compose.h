// The composition operator for N targets (paper 3.3): from depth maps to the set of targets that each candidate sees.
// The paper's {N, P_A, P_B, V} are the four values of two bits.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/aggregate/candidates.h"
#include "server/base/error.h"
#include "server/sample/depth_map.h"

namespace sightline {

enum class Volume { kLattice, kPair };

struct AggregateSettings {
  Volume volume = Volume::kLattice;
  int candidates = 343;          // [27, 32768]; about how many lattice points the bound holds
  double relative_bias = 0.001;  // [0, 0.1]; slack of the distance comparison: too small and surfaces hide themselves,
                                 // too large and thin occluders next to the candidate are missed
};
Status validate(const AggregateSettings& settings);

// Which of `maps` belong to a target: maps[first .. first + count).
struct MapRange {
  uint32_t first = 0;
  uint32_t count = 0;
};

// Where one map shows a point: its texel, or nothing.
struct Sight {
  bool known = false;     // the point lies in the window of one of the maps
  bool visible = false;   // and nothing stands between
  uint32_t occluder = kNoOccluder;  // what does, when not visible
};

// Whether `point_m` sees the point from which the maps were taken: its distance is compared with the texel's. At
// equality it is visible; an unknown point is not.
Sight look_up(std::span<const DepthMap> maps, const glm::dvec3& point_m, double relative_bias);

// Sets bit i of visible_targets of every candidate that target i's maps show as visible; clears the others.
// O(candidates * maps).
void compose_visibility(std::span<const DepthMap> maps, std::span<const MapRange> maps_of_target, double relative_bias,
                        CandidateSet& candidates);

// How many candidates see how much. `steered` has a bit for each target that counts.
struct SightCounts {
  uint32_t total = 0, all_visible = 0, some_visible = 0, none_visible = 0;
  std::vector<uint32_t> visible_by_target;
};
void count_sights(const CandidateSet& candidates, uint32_t steered, size_t target_count, SightCounts& counts);

}  // namespace sightline
