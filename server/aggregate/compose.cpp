#include "server/aggregate/compose.h"

#include <algorithm>
#include <bit>

#include "server/base/check.h"
#include "server/base/vector_clones.h"

namespace sightline {
namespace {

SIGHTLINE_VECTOR_CLONES
void count_visible(const int32_t* __restrict sights, size_t count, int32_t* __restrict seen) {
  for (size_t i = 0; i < count; ++i) seen[i] += sights[i] == kVisibleSight;
}

SIGHTLINE_VECTOR_CLONES
void set_bit_where_enough(const int32_t* __restrict seen, size_t count, int32_t least, uint32_t bit,
                          uint32_t* __restrict visible) {
  for (size_t i = 0; i < count; ++i) visible[i] |= seen[i] >= least ? bit : 0u;
}

SIGHTLINE_VECTOR_CLONES
void add_staying(const int32_t* __restrict sights, size_t count, double share, double* __restrict hidden) {
  for (size_t i = 0; i < count; ++i)
    hidden[i] += (sights[i] == kHiddenSight) | (sights[i] == kUnknownSight) ? share : 0.0;
}

SIGHTLINE_VECTOR_CLONES
void add_passing(const int32_t* __restrict sights, size_t count, double share, double* __restrict hidden) {
  for (size_t i = 0; i < count; ++i) hidden[i] += sights[i] == kPassingSight ? share : 0.0;
}

// The least number of seen points that is enough; more than there are when none is.
int32_t least_enough(uint32_t points, double needed_share) {
  uint32_t seen = 0;
  while (seen <= points && !is_enough(seen, points, needed_share)) ++seen;
  return static_cast<int32_t>(seen);
}

double sum_of(std::span<const double> weights) {
  double total = 0;
  for (const double w : weights) total += w;
  return total;
}

}  // namespace

bool is_enough(uint32_t seen, uint32_t points, double needed_share) {
  return seen > 0 && seen >= needed_share * points - 1e-9;
}

void Composer::visibility(const SampledPoints& sampled, double relative_bias, std::vector<uint32_t>& visible) {
  compose(sampled, relative_bias, {}, &visible, nullptr);
}

void Composer::add_hidden(const SampledPoints& sampled, double relative_bias, const HiddenWeights& weights,
                          HiddenShares& hidden) {
  compose(sampled, relative_bias, weights, nullptr, &hidden);
}

void Composer::visibility_and_hidden(const SampledPoints& sampled, double relative_bias, const HiddenWeights& weights,
                                     std::vector<uint32_t>& visible, HiddenShares& hidden) {
  compose(sampled, relative_bias, weights, &visible, &hidden);
}

void Composer::compose(const SampledPoints& sampled, double relative_bias, const HiddenWeights& weights,
                       std::vector<uint32_t>* visible, HiddenShares* hidden) {
  const size_t count = look_up_.size();
  const double total = sum_of(weights.of_target);
  if (visible) visible->assign(count, 0);
  for (size_t target = 0; target < sampled.points_of_target.size(); ++target) {
    const MapRange& points = sampled.points_of_target[target];
    const bool hides = hidden && total > 0 && points.count > 0 && weights.of_target[target] > 0;
    if (!hides && !visible) continue;
    const double each = hides ? weights.weight * weights.of_target[target] / (total * points.count) : 0.0;
    seen_.assign(count, 0);
    for (const MapRange& range : sampled.maps_of_point.subspan(points.first, points.count)) {
      const auto maps = sampled.maps.subspan(range.first, range.count);
      const auto sights = look_up_(maps, relative_bias, hides ? weights.passes : std::span<const uint8_t>{});
      if (visible) count_visible(sights.data(), count, seen_.data());
      if (hides) add_staying(sights.data(), count, each, hidden->by_staying.data());
      if (hides && look_up_.any_passing())
        add_passing(sights.data(), count, each, hidden->by_passing.data());
    }
    if (visible)
      set_bit_where_enough(seen_.data(), count, least_enough(points.count, sampled.needed_share), 1u << target,
                           visible->data());
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
