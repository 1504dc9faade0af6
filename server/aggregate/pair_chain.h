// Pair volumes chained, for any number of targets from two on (paper 3.3, Figure 2; design 4.2).
//
// For targets A, B, C, D the volumes V_AB, V_BC, V_CD. The candidates are the meeting points of V_AB, where both A and B are known
// exactly. Each is then expressed in the basis of V_BC, by its closed-form inverse, which says in what texel of C's picture it
// falls; and so on. Every target is rendered once: a volume of the chain shares its first target with one before it, and that
// one's picture is already there. A candidate lies on the ray of one texel of B's picture, so that resampling this picture for
// V_BC would only find that texel again: B's bit is known, and of V_BC only C's picture is taken.
//
// All volumes must be complete (pair_gap). Where a link of the list's order is not, the target is joined to another one that is
// already in: what a volume needs of its first target is only that it is in, not that it is the last. So there is a chain, in
// general a tree, exactly when the complete pairs connect all targets.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/aggregate/pair_volume.h"

namespace sightline {

// The volume that brings target `to` in, by target `from`, which is in. Indices of the list of targets; `from` is A of the volume
// and `to` is B.
struct ChainLink {
  uint32_t from = 0, to = 0;
  PairVolume volume;
};

// In the order of composition: the first link begins at target 0 and gives the candidates. One link fewer than targets. Memory is
// reused from step to step.
struct PairChain {
  std::vector<ChainLink> links;
};

// Chains all targets, one point of each, [2, 32] of them. `resolution` is the texels a side of every map. When the complete pairs do
// not connect them: why the first target of the list that is left out does not join the one before it, and `chain` is unspecified.
// With two targets this is pair_gap, and the one volume is make_pair_volume's.
PairGap make_pair_chain(std::span<const glm::dvec3> points_m, const Bound& bound, int resolution,
                        PairChain& chain);

// The one map to take from a target of the chain.
MapView chain_view(const PairChain& chain, uint32_t target, const glm::dvec2& jitter);

// Lists the meeting points of the first volume that lie in the bound, bit i for target i. maps[i] is the one that was taken by
// chain_view(chain, i, jitter), the same jitter in all. The two targets of the first link are compared at the texels whose rays meet in
// the candidate, every other one at the texel that the candidate falls into. O(candidates * targets).
void compose_chain(const PairChain& chain, std::span<const DepthMap> maps, const Bound& bound,
                   double relative_bias, CandidateSet& candidates);

}  // namespace sightline
