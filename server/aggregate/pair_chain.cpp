#include "server/aggregate/pair_chain.h"

#include <algorithm>
#include <cassert>
#include <optional>

namespace sightline {
namespace {

// The target to which target `i` is joined: the one before it in the list if possible, else the newest one of the chain that is possible.
std::optional<uint32_t> partner_of(std::span<const glm::dvec3> points_m, const Bound& bound,
                                   const PairChain& chain, uint32_t joined, uint32_t i) {
  const auto brings_in = [&](uint32_t other) {
    return pair_gap(points_m[other], points_m[i], bound) == PairGap::kNone;
  };
  if ((joined >> (i - 1) & 1u) && brings_in(i - 1)) return i - 1;
  for (size_t k = chain.links.size(); k-- > 0;)
    if (brings_in(chain.links[k].to)) return chain.links[k].to;
  if (brings_in(0)) return 0;
  return std::nullopt;
}

// Compares every candidate with the map of the link's second target. A candidate at the edge of the bound may be outside the window by
// rounding.
void add_bits(const ChainLink& link, const DepthMap& map, double slack, CandidateSet& candidates) {
  const MapView& view = map.view;
  for (size_t i = 0; i < candidates.size(); ++i) {
    const MapPoint at = project(view, candidates.position_m[i]);
    const int x = nearest_ray(at.x, view.jitter.x, view.width), y = nearest_ray(at.y, view.jitter.y, view.height);
    if (at.depth_m <= map.depth_at(x, y) * slack) candidates.visible_targets[i] |= 1u << link.to;
  }
}

// Moves bit 1, which compose_pair sets for B, to bit `to`.
void move_second_bit(uint32_t to, std::vector<uint32_t>& masks) {
  for (uint32_t& mask : masks) mask = (mask & 1u) | (mask >> 1 & 1u) << to;
}

}  // namespace

PairGap make_pair_chain(std::span<const glm::dvec3> points_m, const Bound& bound, int resolution,
                        PairChain& chain) {
  const auto count = static_cast<uint32_t>(points_m.size());
  assert(count >= 2 && count <= 32);
  chain.links.clear();
  uint32_t joined = 1;
  for (bool grows = true; grows;) {
    grows = false;
    for (uint32_t i = 1; i < count; ++i) {
      if (joined >> i & 1u) continue;
      const auto partner = partner_of(points_m, bound, chain, joined, i);
      if (!partner) continue;
      chain.links.push_back(
          {*partner, i, make_pair_volume(points_m[*partner], points_m[i], bound, resolution)});
      joined |= 1u << i;
      grows = true;
    }
  }
  for (uint32_t i = 1; i < count; ++i)
    if (!(joined >> i & 1u)) return pair_gap(points_m[i - 1], points_m[i], bound);
  return PairGap::kNone;
}

MapView chain_view(const PairChain& chain, uint32_t target, const glm::dvec2& jitter) {
  const auto link = std::find_if(chain.links.begin(), chain.links.end(),
                                 [=](const ChainLink& l) { return l.to == target; });
  // Target 0 is the only one that is no link's second target: it is the first target of the first link.
  return link == chain.links.end() ? pair_views(chain.links.front().volume, jitter)[0]
                                   : pair_views(link->volume, jitter)[1];
}

void compose_chain(const PairChain& chain, std::span<const DepthMap> maps, const Bound& bound,
                   double relative_bias, CandidateSet& candidates) {
  const ChainLink& first = chain.links.front();
  compose_pair(first.volume, maps[first.from], maps[first.to], bound, relative_bias, candidates);
  if (first.to != 1) move_second_bit(first.to, candidates.visible_targets);
  for (const ChainLink& link : std::span(chain.links).subspan(1))
    add_bits(link, maps[link.to], 1.0 + relative_bias, candidates);
}

}  // namespace sightline
