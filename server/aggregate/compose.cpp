#include "server/aggregate/compose.h"

#include <algorithm>
#include <cassert>

#include "server/base/vector_clones.h"

namespace sightline {
namespace {

SIGHTLINE_VECTOR_CLONES
void count_sight(const uint8_t* __restrict sights, size_t count, uint8_t sight, uint8_t* __restrict points) {
  for (size_t i = 0; i < count; ++i) points[i] = static_cast<uint8_t>(points[i] + (sights[i] == sight));
}

// Points that are neither seen nor hidden by passing occluders count as hidden by occluders that stay.
SIGHTLINE_VECTOR_CLONES
void count_staying(const uint8_t* __restrict seen, const uint8_t* __restrict passing, size_t count, uint8_t points,
                   uint8_t* __restrict staying) {
  for (size_t i = 0; i < count; ++i) staying[i] = static_cast<uint8_t>(points - seen[i] - passing[i]);
}

SIGHTLINE_VECTOR_CLONES
void set_bit_where_enough(const uint8_t* __restrict seen, size_t count, uint8_t least, uint32_t bit,
                          uint32_t* __restrict visible) {
  for (size_t i = 0; i < count; ++i) visible[i] |= seen[i] >= least ? bit : 0u;
}

// Adds the share once for each hidden point, because a product would round differently.
SIGHTLINE_VECTOR_CLONES
void add_times(const uint8_t* __restrict times, size_t count, double share, double* __restrict sums) {
  uint8_t most = 0;
  for (size_t i = 0; i < count; ++i) most = times[i] > most ? times[i] : most;
  for (uint8_t k = 0; k < most; ++k)
    for (size_t i = 0; i < count; ++i) sums[i] += times[i] > k ? share : 0.0;
}

SIGHTLINE_VECTOR_CLONES
uint32_t count_masked(const uint32_t* visible, size_t count, uint32_t mask, uint32_t wanted) {
  uint32_t found = 0;
  for (size_t i = 0; i < count; ++i) found += (visible[i] & mask) == wanted;
  return found;
}

constexpr size_t kCountedTogether = 4096;

// The least number of seen points that is enough, or points + 1 when no number is.
uint8_t least_enough(uint32_t points, double visibility_threshold) {
  uint32_t seen = 0;
  while (seen <= points && !is_enough(seen, points, visibility_threshold)) ++seen;
  return static_cast<uint8_t>(seen);
}

double sum_of(std::span<const double> weights) {
  double total = 0;
  for (const double w : weights) total += w;
  return total;
}

}  // namespace

bool is_enough(uint32_t seen, uint32_t points, double visibility_threshold) {
  return seen > 0 && seen >= visibility_threshold * points - 1e-9;
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

// Point counts of one target for each position of a tile.
struct Composer::Tile {
  SightTile sights;
  uint8_t seen[kTilePlaces], staying[kTilePlaces], passing[kTilePlaces];
  bool any_passing;
  size_t next_map;  // index of the next prepared map
};

void Composer::compose(const SampledPoints& sampled, double relative_bias, const HiddenWeights& weights,
                       std::vector<uint32_t>* visible, HiddenShares* hidden) {
  look_up_.begin_maps(relative_bias, hidden ? weights.passes : std::span<const uint8_t>{});
  look_up_.expect_maps(sampled.maps);
  ask(sampled, weights, visible != nullptr, hidden != nullptr);
  if (visible) visible->assign(look_up_.size(), 0);
  if (asked_.empty()) return;
  Tile tile;
  for (size_t number = 0; number < look_up_.tile_count(); ++number) {
    look_up_.load_tile(number, tile.sights);
    compose_tile(sampled, tile, visible ? visible->data() + tile.sights.places.first : nullptr, hidden);
  }
}

// Lists the targets of this call, and has their maps prepared in the same order.
void Composer::ask(const SampledPoints& sampled, const HiddenWeights& weights, bool visible, bool hidden) {
  asked_.clear();
  const double total = sum_of(weights.of_target);
  for (uint32_t target = 0; target < sampled.points_of_target.size(); ++target) {
    Asked asked{.target = target, .points = sampled.points_of_target[target]};
    const uint32_t points = asked.points.count;
    assert(points < 255);
    asked.hides = hidden && total > 0 && points > 0 && weights.of_target[target] > 0;
    if (points == 0 || (!asked.hides && !visible)) continue;
    if (asked.hides) asked.each = weights.weight * weights.of_target[target] / (total * points);
    asked.least = least_enough(points, sampled.visibility_threshold);
    asked_.push_back(asked);
    for (const MapRange& maps : sampled.maps_of_point.subspan(asked.points.first, points))
      look_up_.add_maps(sampled.maps.subspan(maps.first, maps.count));
  }
}

void Composer::compose_tile(const SampledPoints& sampled, Tile& tile, uint32_t* visible, HiddenShares* hidden) {
  const size_t count = tile.sights.places.count, first = tile.sights.places.first;
  tile.next_map = 0;
  for (const Asked& asked : asked_) {
    count_points(sampled, asked, tile);
    if (visible) set_bit_where_enough(tile.seen, count, asked.least, 1u << asked.target, visible);
    if (!asked.hides) continue;
    count_staying(tile.seen, tile.passing, count, static_cast<uint8_t>(asked.points.count), tile.staying);
    add_times(tile.staying, count, asked.each, hidden->by_staying.data() + first);
    if (tile.any_passing) add_times(tile.passing, count, asked.each, hidden->by_passing.data() + first);
  }
}

void Composer::count_points(const SampledPoints& sampled, const Asked& asked, Tile& tile) {
  const size_t count = tile.sights.places.count;
  tile.any_passing = false;
  std::fill_n(tile.seen, count, uint8_t{0});
  std::fill_n(tile.passing, count, uint8_t{0});
  for (const MapRange& maps : sampled.maps_of_point.subspan(asked.points.first, asked.points.count)) {
    const std::span<const uint8_t> sights = look_up_.look(tile.next_map, maps.count, tile.sights);
    tile.next_map += maps.count;
    count_sight(sights.data(), count, kVisibleSight, tile.seen);
    if (!asked.hides || !look_up_.any_passing()) continue;
    count_sight(sights.data(), count, kPassingSight, tile.passing);
    tile.any_passing = true;
  }
}

void count_sights(const CandidateSet& candidates, uint32_t steered, size_t target_count, SightCounts& counts) {
  counts.total = static_cast<uint32_t>(candidates.size());
  // One part at a time, so that it stays in the L1 cache while everything is counted.
  const std::span<const uint32_t> visible = candidates.filtered();
  counts.all_visible = counts.none_visible = 0;
  counts.visible_by_target.assign(target_count, 0);
  for (size_t first = 0; first < visible.size(); first += kCountedTogether) {
    const std::span<const uint32_t> part = visible.subspan(first, std::min(kCountedTogether, visible.size() - first));
    counts.all_visible += count_masked(part.data(), part.size(), steered, steered);
    counts.none_visible += count_masked(part.data(), part.size(), steered, 0);
    for (size_t target = 0; target < target_count; ++target)
      counts.visible_by_target[target] += count_masked(part.data(), part.size(), 1u << target, 1u << target);
  }
  // Without a steered target, no candidate counts as seeing all.
  if (steered == 0) counts.all_visible = 0;
  counts.some_visible = counts.total - counts.all_visible - counts.none_visible;
}

}  // namespace sightline
