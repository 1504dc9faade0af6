#include "server/aggregate/look_up.h"

#include <algorithm>
#include <cassert>
#include <cstring>

namespace sightline {
namespace {

uint8_t sight_of(const Sight& sight, std::span<const uint8_t> passes) {
  if (!sight.known) return kUnknownSight;
  if (sight.visible) return kVisibleSight;
  return sight.occluder != kNoOccluder && !passes.empty() && passes[sight.occluder] != 0 ? kPassingSight : kHiddenSight;
}

}  // namespace

Sight look_up(std::span<const DepthMap> maps, const glm::dvec3& point_m, double relative_bias) {
  for (const DepthMap& map : maps) {
    const MapPoint at = project(map.view, point_m);
    if (!at.in_window) continue;
    const int x = nearest_ray(at.x, map.view.jitter.x, map.view.width),
              y = nearest_ray(at.y, map.view.jitter.y, map.view.height);
    Sight sight{.known = true};
    sight.visible = at.depth_m <= map.depth_at(x, y) * (1.0 + relative_bias);
    if (!sight.visible) sight.occluder = map.occluder_at(x, y);
    return sight;
  }
  return {};
}

void LookUp::set_places(const PlaceView& places) {
  places_ = places;
  extent_ = extent_of(places);
}

void LookUp::begin_maps(double relative_bias, std::span<const uint8_t> passes) {
  relative_bias_ = relative_bias;
  // If no occluder passes, no map has to be searched for them.
  passes_ = passes.empty() || std::memchr(passes.data(), 1, passes.size()) ? passes : std::span<const uint8_t>{};
  maps_.clear();
  limits_m_.clear();
  exact_count_ = 0;
}

void LookUp::expect_maps(std::span<const DepthMap> maps) {
  constexpr size_t kLeastLimits = kSmallMap * kSmallMap;  // see prepare_map
  size_t limits = 0;
  for (const DepthMap& map : maps) limits += std::max(map.distance_m.size(), kLeastLimits);
  maps_.reserve(maps.size());
  limits_m_.reserve(limits);
}

size_t LookUp::add_maps(std::span<const DepthMap> maps) {
  const size_t first = maps_.size();
  for (const DepthMap& map : maps) maps_.push_back(prepare_map(map, extent_, relative_bias_, passes_, limits_m_));
  return first;
}

void LookUp::load_tile(size_t number, SightTile& tile) const {
  fill_tile(places_, number * kTilePlaces, extent_.middle_m, tile.places);
}

// Looks up the unsure candidates one by one.
void LookUp::settle(std::span<const DepthMap> maps, SightTile& tile) {
  uint8_t* const end = tile.sights + tile.places.count;
  for (uint8_t* at = tile.sights;; ++at) {
    at = static_cast<uint8_t*>(std::memchr(at, kUnsureSight, static_cast<size_t>(end - at)));
    if (!at) return;
    const glm::dvec3 place_m = places_[tile.places.first + static_cast<size_t>(at - tile.sights)];
    *at = sight_of(look_up(maps, place_m, relative_bias_), passes_);
    any_passing_ |= *at == kPassingSight;
    ++exact_count_;
  }
}

std::span<const uint8_t> LookUp::look(size_t first_map, size_t count, SightTile& tile) {
  assert(first_map + count <= maps_.size());
  any_passing_ = false;
  if (count == 0) std::fill_n(tile.sights, tile.places.count, uint8_t{kUnknownSight});
  bool unsure = false;
  for (size_t k = 0; k < count; ++k) {
    const PreparedMap& map = maps_[first_map + k];
    unsure |= look_at_map(map, limits_m_.data(), tile.places, k == 0, tile.sights);
    any_passing_ |= map.passing;
  }
  if (unsure) settle({maps_[first_map].map, count}, tile);
  return {tile.sights, tile.places.count};
}

}  // namespace sightline
