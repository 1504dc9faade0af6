#include "server/paper/pair_chain.h"

#include <algorithm>
#include <cassert>
#include <optional>

namespace sightline {
namespace {

// The target to which target `i` is joined: the one before it in the list if possible, else the newest one of the chain
// that is possible.
std::optional<uint32_t> partner_of(std::span<const glm::dvec3> points_m, const Bound& bound, const PairChain& chain,
                                   uint32_t joined, uint32_t i) {
  const auto brings_in = [&](uint32_t other) {
    return pair_gap(points_m[other], points_m[i], bound) == PairGap::kNone;
  };
  if ((joined >> (i - 1) & 1u) && brings_in(i - 1)) return i - 1;
  for (size_t k = chain.links.size(); k-- > 0;)
    if (brings_in(chain.links[k].to)) return chain.links[k].to;
  if (brings_in(0)) return 0;
  return std::nullopt;
}

// Whether a target of the chain is seen from a point by the ray that passes nearest to it; empty if the point is
// outside the volume.
std::optional<bool> sees(const ChainLink& link, const DepthMap& map, double slack, const glm::dvec3& point_m) {
  const auto near = nearest_texels(link.volume, point_m, map.view.jitter);
  if (!near) return std::nullopt;
  return project(map.view, point_m).depth_m <= map.depth_at(near->x, near->y) * slack;
}

// Whether a meeting point of the first volume is inside all others.
bool has_candidates(const PairChain& chain, const Bound& bound, const glm::dvec2& jitter) {
  const std::span<const ChainLink> later = std::span(chain.links).subspan(1);
  bool any = false;
  for_each_meeting(chain.links.front().volume, bound, jitter, [&](const glm::ivec3&, const glm::dvec3& point_m) {
    any = any || std::ranges::all_of(later, [&](const ChainLink& link) {
            return nearest_texels(link.volume, point_m, jitter).has_value();
          });
  });
  return any;
}

}  // namespace

PairGap make_pair_chain(std::span<const glm::dvec3> points_m, const Bound& bound, int resolution,
                        const glm::dvec2& jitter, PairChain& chain) {
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
      chain.links.push_back({*partner, i, make_pair_volume(points_m[*partner], points_m[i], bound, resolution)});
      joined |= 1u << i;
      grows = true;
    }
  }
  for (uint32_t i = 1; i < count; ++i)
    if (!(joined >> i & 1u)) return pair_gap(points_m[i - 1], points_m[i], bound);
  return has_candidates(chain, bound, jitter) ? PairGap::kNone : PairGap::kTooClose;
}

MapView chain_view(const PairChain& chain, uint32_t target, const glm::dvec2& jitter) {
  const auto link = std::find_if(chain.links.begin(), chain.links.end(),
                                 [=](const ChainLink& l) { return l.to == target; });
  // Target 0 is the only one that is no link's second target: it is the first target of the first link.
  return link == chain.links.end() ? pair_views(chain.links.front().volume, jitter)[0]
                                   : pair_views(link->volume, jitter)[1];
}

void compose_chain(const PairChain& chain, std::span<const DepthMap> maps, const Bound& bound, double relative_bias,
                   CandidateSet& candidates, std::vector<glm::ivec3>& texels) {
  candidates.clear();
  texels.clear();
  const ChainLink& first = chain.links.front();
  const DepthMap &map_a = maps[first.from], &map_b = maps[first.to];
  const double slack = 1.0 + relative_bias;
  for_each_meeting(first.volume, bound, map_a.view.jitter, [&](const glm::ivec3& uvw, const glm::dvec3& point_m) {
    const bool sees_a = glm::distance(point_m, map_a.view.eye_m) <=
                        map_a.distance_at(first.volume.resolution - 1 - uvw.z, uvw.y) * slack;
    const bool sees_b = glm::distance(point_m, map_b.view.eye_m) <= map_b.distance_at(uvw.x, uvw.y) * slack;
    uint32_t visible = (sees_a ? 1u << first.from : 0u) | (sees_b ? 1u << first.to : 0u);
    for (const ChainLink& link : std::span(chain.links).subspan(1)) {
      const std::optional<bool> seen = sees(link, maps[link.to], slack, point_m);
      if (!seen) return;
      if (*seen) visible |= 1u << link.to;
    }
    candidates.add(point_m, visible);
    texels.push_back(uvw);
  });
}

}  // namespace sightline
