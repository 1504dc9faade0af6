#include "server/aggregate/compose.h"

#include <algorithm>
#include <bit>

#include "server/base/check.h"

namespace sightline {
namespace {

// seen[i]: how many of a target's points position i sees.
void count_seen(const SampledPoints& sampled, const MapRange& points, double relative_bias,
                std::span<const glm::dvec3> position_m, std::vector<uint8_t>& seen) {
  seen.assign(position_m.size(), 0);
  for (const MapRange& range : sampled.maps_of_point.subspan(points.first, points.count)) {
    const auto maps = sampled.maps.subspan(range.first, range.count);
    for (size_t i = 0; i < position_m.size(); ++i)
      seen[i] += look_up(maps, position_m[i], relative_bias).visible;
  }
}

}  // namespace

bool is_enough(uint32_t seen, uint32_t points, double needed_share) {
  return seen > 0 && seen >= needed_share * points - 1e-9;
}

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

void compose_visibility(const SampledPoints& sampled, double relative_bias,
                        std::span<const glm::dvec3> position_m, std::vector<uint8_t>& seen,
                        std::vector<uint32_t>& visible) {
  visible.assign(position_m.size(), 0);
  for (size_t target = 0; target < sampled.points_of_target.size(); ++target) {
    const MapRange& points = sampled.points_of_target[target];
    count_seen(sampled, points, relative_bias, position_m, seen);
    for (size_t i = 0; i < position_m.size(); ++i)
      if (is_enough(seen[i], points.count, sampled.needed_share)) visible[i] |= 1u << target;
  }
}

void add_hidden(const SampledPoints& sampled, double relative_bias, std::span<const uint8_t> passes,
                std::span<const glm::dvec3> position_m, std::span<const double> weight_of_target,
                double weight, HiddenShares& hidden) {
  double total = 0;
  for (const double w : weight_of_target) total += w;
  if (!(total > 0)) return;
  for (size_t target = 0; target < sampled.points_of_target.size(); ++target) {
    const MapRange& points = sampled.points_of_target[target];
    if (points.count == 0 || weight_of_target[target] <= 0) continue;
    const double each = weight * weight_of_target[target] / (total * points.count);
    for (const MapRange& range : sampled.maps_of_point.subspan(points.first, points.count)) {
      const auto maps = sampled.maps.subspan(range.first, range.count);
      for (size_t i = 0; i < position_m.size(); ++i) {
        const Sight sight = look_up(maps, position_m[i], relative_bias);
        if (sight.visible) continue;
        const bool passing = sight.occluder != kNoOccluder && passes[sight.occluder] != 0;
        (passing ? hidden.by_passing : hidden.by_staying)[i] += each;
      }
    }
  }
}

void count_sights(const CandidateSet& candidates, uint32_t steered, size_t target_count,
                  SightCounts& counts) {
  counts.total = static_cast<uint32_t>(candidates.size());
  counts.all_visible = counts.some_visible = counts.none_visible = 0;
  counts.visible_by_target.assign(target_count, 0);
  for (const uint32_t visible : candidates.filtered_targets) {
    const uint32_t seen = visible & steered;
    ++(seen == 0 ? counts.none_visible : seen == steered ? counts.all_visible : counts.some_visible);
    for (uint32_t rest = visible; rest != 0; rest &= rest - 1)
      ++counts.visible_by_target[std::countr_zero(rest)];
  }
}

Status validate(const AggregateSettings& s) {
  if (auto ok = check_range("aggregate.candidates", s.candidates, 27, 32768); !ok) return ok;
  if (auto ok = check_range("aggregate.needed_share", s.needed_share, 0.0, 1.0); !ok) return ok;
  if (auto ok = validate(s.filter); !ok) return ok;
  return check_range("aggregate.relative_bias", s.relative_bias, 0.0, 0.1);
}

}  // namespace sightline
