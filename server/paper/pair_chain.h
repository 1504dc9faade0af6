// Chains pair volumes for two or more targets (paper 3.3, Figure 2).
//
// Targets A, B, C, D have the volumes V_AB, V_BC, V_CD. The candidates are the meeting points of V_AB, where the
// visibility of A and B is known exactly. Each candidate is then expressed in the basis of V_BC by its closed-form
// inverse, which gives its texel in C's map; and so on. A candidate outside V_BC has no coordinates there, and is
// dropped. One map of every target is enough, since each volume shares its first target with an earlier one. A
// candidate is on the ray of one texel of B's map, so looking it up in B's map again for V_BC, or in a copy resampled
// to the window of V_BC, would find the same texel.
//
// Where two neighbours in the list have no volume (pair_gap), the target is joined to another target that is in the
// chain already. So a chain (in general a tree) exists exactly when the pairs that have a volume connect all targets.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/aggregate/candidates.h"
#include "server/paper/pair_volume.h"

namespace sightline {

// The volume that joins target `to` to target `from`, which is in the chain already. Both are indices of the list of
// targets; `from` is A of the volume and `to` is B.
struct ChainLink {
  uint32_t from = 0, to = 0;
  PairVolume volume;
};

// The links in the order of composition, one fewer than targets. The first link begins at target 0 and gives the
// candidates. Memory is reused from step to step.
struct PairChain {
  std::vector<ChainLink> links;
};

// Chains 2 to 32 targets, given one point of each. `resolution` is the number of texels on each side of every map, and
// `jitter` that of the maps. When the pairs do not connect all targets, `chain` is unspecified. The result is then the
// pair_gap between the first target left out and its predecessor in the list. With two targets the one volume is
// make_pair_volume's. kTooClose also where the chain has no candidate: no rays of the first volume meet inside the
// bound and all later volumes.
PairGap make_pair_chain(std::span<const glm::dvec3> points_m, const Bound& bound, int resolution,
                        const glm::dvec2& jitter, PairChain& chain);

// The one map to take from a target of the chain.
MapView chain_view(const PairChain& chain, uint32_t target, const glm::dvec2& jitter);

// Lists the meeting points of the first volume that are in the bound, with bit i for target i. The map of target i,
// maps[i], must be taken by chain_view(chain, i, jitter), with the same jitter for all targets. The two targets of the
// first link are compared at the texels whose rays meet in the candidate, every other target at the ray that passes
// nearest to it. `texels` becomes the (u, v, w) of each candidate in the first volume. O(r^3 * targets).
void compose_chain(const PairChain& chain, std::span<const DepthMap> maps, const Bound& bound, double relative_bias,
                   CandidateSet& candidates, std::vector<glm::ivec3>& texels);

}  // namespace sightline
