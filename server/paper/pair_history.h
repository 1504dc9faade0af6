// The temporal visibility volume over pair volumes (paper 5): what each candidate of the present volume saw in the last
// n steps.
//
// The volumes of successive steps are different grids, so a candidate has no cell of its own in the past. As in the
// paper, its state in an earlier step is found by the inverse coordinates in the volume of that step, whose depths are
// kept. A step in whose volume the candidate has no coordinates is out of bounds, and is not counted. So are steps that
// took no pair volume, and steps that did not know one of the targets. The filter over these states is the joint one
// (filter.h).
//
// In each step in which time passes:
//
//   history.push(chain, maps, target_ids, relative_bias, n);  // or push_none(n)
//   history.filter(position_m, visible_now, target_ids, steered, settings, filtered);
//
// The cost is the paper's O(n g^3). Its O(g^3), "by locally storing frame indices for each component visibility state",
// is exact only where each candidate stays the same from step to step: when neither the camera nor a target moves and
// the same points of the targets are sampled again.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "server/aggregate/filter.h"
#include "server/paper/pair_chain.h"

namespace sightline {

// Copyable and deterministic. Memory is reused from step to step.
class PairHistory {
 public:
  // `maps` and `chain` are those of compose_chain, `target_ids` the targets in the order of the maps. n in [0,
  // kHistorySteps] is the number of steps, with the present one, that a filter looks at; older ones are dropped. 0
  // counts as 1.
  void push(const PairChain& chain, std::span<const DepthMap> maps, std::span<const uint64_t> target_ids,
            double relative_bias, int n);
  void push_none(int n);
  void clear() { frames_.clear(), newest_ = 0; }

  // Sets filtered[i] to the targets that the filter takes as seen from position_m[i], which sees visible_now[i] in the
  // step that was pushed last. Targets outside the mask `steered` form no part of the state and are as visible_now
  // says.
  void filter(std::span<const glm::dvec3> position_m, std::span<const uint32_t> visible_now,
              std::span<const uint64_t> target_ids, uint32_t steered, const FilterSettings& settings,
              std::vector<uint32_t>& filtered);

 private:
  friend struct StateFields;  // lists its fields, to write and read them as bytes (server/session/state_fields.h)
  // One step. Without links: it took no pair volume.
  struct Frame {
    std::vector<uint64_t> target_ids;
    std::vector<ChainLink> links;
    glm::dvec2 jitter{0.5};
    double slack = 1.0;  // factor of a depth at which a point still counts as seen
    // of the texels of each target's map, target by target; kBeyondAllM where nothing occludes
    std::vector<double> depth_m;
  };
  static constexpr double kBeyondAllM = 1e300;
  static bool look_up(const Frame& frame, const glm::dvec3& point_m, uint32_t& visible);
  Frame& next(int n);

  std::vector<Frame> frames_;  // a ring of n
  size_t newest_ = 0;
  std::vector<VisibilityRecord> records_;         // of one candidate, by target
  std::vector<std::vector<int>> index_in_frame_;  // by frame and present target; -1: unknown there
};

}  // namespace sightline
