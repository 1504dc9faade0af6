#include "server/aggregate/compose.h"

#include <algorithm>
#include <bit>

#include "server/base/check.h"

namespace sightline {

Sight look_up(std::span<const DepthMap> maps, const glm::dvec3& point_m, double relative_bias) {
  for (const DepthMap& map : maps) {
    const MapPoint at = project(map.view, point_m);
    if (!at.in_window) continue;
    const int x = static_cast<int>(at.x), y = static_cast<int>(at.y);
    Sight sight{.known = true};
    sight.visible = at.distance_m <= map.distance_at(x, y) * (1.0 + relative_bias);
    if (!sight.visible) sight.occluder = map.occluder_at(x, y);
    return sight;
  }
  return {};
}

void compose_visibility(std::span<const DepthMap> maps, std::span<const MapRange> maps_of_target, double relative_bias,
                        CandidateSet& candidates) {
  std::fill(candidates.visible_targets.begin(), candidates.visible_targets.end(), 0u);
  for (size_t target = 0; target < maps_of_target.size(); ++target) {
    const auto own = maps.subspan(maps_of_target[target].first, maps_of_target[target].count);
    const uint32_t bit = 1u << target;
    for (size_t i = 0; i < candidates.size(); ++i)
      if (look_up(own, candidates.position_m[i], relative_bias).visible) candidates.visible_targets[i] |= bit;
  }
}

void count_sights(const CandidateSet& candidates, uint32_t steered, size_t target_count, SightCounts& counts) {
  counts.total = static_cast<uint32_t>(candidates.size());
  counts.all_visible = counts.some_visible = counts.none_visible = 0;
  counts.visible_by_target.assign(target_count, 0);
  for (const uint32_t visible : candidates.visible_targets) {
    const uint32_t seen = visible & steered;
    ++(seen == 0 ? counts.none_visible : seen == steered ? counts.all_visible : counts.some_visible);
    for (uint32_t rest = visible; rest != 0; rest &= rest - 1) ++counts.visible_by_target[std::countr_zero(rest)];
  }
}

Status validate(const AggregateSettings& s) {
  if (auto ok = check_range("aggregate.candidates", s.candidates, 27, 32768); !ok) return ok;
  return check_range("aggregate.relative_bias", s.relative_bias, 0.0, 0.1);
}

}  // namespace sightline
