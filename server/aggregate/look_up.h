// Looks candidates up in depth maps: does a candidate see the point from which a map was taken? `look_up` answers for
// one candidate in double precision, and `LookUp` for many at once with the same answers.
//
// LookUp works in single precision, with one division for each candidate and map, and eight or sixteen candidates an
// instruction. Every number has a bound of its rounding error. Where the error could change the answer, LookUp falls
// back to `look_up`. This happens to a few candidates in 10,000: those about as near to another ray, and those close to
// the window's edge, to the eye's plane or to the texel's depth. This is the floating-point filter of exact geometric
// predicates (Fortune & Van Wyk, "Static analysis yields efficient exact integer arithmetic for computational
// geometry", 1996; Shewchuk, "Adaptive precision floating-point arithmetic", 1997).
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "server/aggregate/places.h"
#include "server/aggregate/prepared_map.h"
#include "server/sample/depth_map.h"

namespace sightline {

// The result of looking up a position in the maps of one point.
struct Sight {
  bool known = false;               // the position is in the window of one of the maps
  bool visible = false;             // known, and nothing is between the position and the point
  uint32_t occluder = kNoOccluder;  // mirror slot of the occluder when known and not visible
};

// Returns whether `point_m` sees the point from which the maps were taken: by the ray that passes nearest to `point_m`
// (see sample/depth_map.h).
Sight look_up(std::span<const DepthMap> maps, const glm::dvec3& point_m, double relative_bias);

// A tile of candidates and what they see. Keep this scratch memory of 13 KiB on the stack: a thread's stack is in the
// cache, where the memory of one of many sessions is not.
struct SightTile {
  PlaceTile places;
  uint8_t sights[kTilePlaces + PlaceTile::kTilePad];
};

// Looks up one tile of candidates after the other in all maps, so that a tile stays in the L1 cache. Order of calls:
//
//   set_places(places); begin_maps(bias, passes); first = add_maps(of a point) ...;
//   load_tile(0, tile); look(first, count, tile) ...; load_tile(1, tile) ...
//
// Memory is kept from call to call. Not thread-safe. Deterministic; the same on every machine.
class LookUp {
 public:
  // Sets the candidates for the following calls. The memory behind the view must outlive them.
  void set_places(const PlaceView& places);
  size_t size() const { return places_.size(); }
  size_t tile_count() const { return (size() + kTilePlaces - 1) / kTilePlaces; }

  // Begins a new list of maps; relative_bias in [0, 0.1]. `passes` has an entry for each mirror slot: 1 for occluders
  // that move and may soon be gone; empty: none. It must outlive the calls of `look`.
  void begin_maps(double relative_bias, std::span<const uint8_t> passes = {});
  // Makes room for all of these maps, so that adding some of them allocates only where these are more than ever before.
  void expect_maps(std::span<const DepthMap> maps);
  // Adds all maps of one point, which must outlive the calls of `look`. Returns the index of the first.
  size_t add_maps(std::span<const DepthMap> maps);

  void load_tile(size_t number, SightTile& tile) const;
  // A PlaceSight for each candidate of the tile, by the maps [first_map, first_map + count) of one point. Valid until
  // the tile is used again.
  std::span<const uint8_t> look(size_t first_map, size_t count, SightTile& tile);
  // Returns whether the last call of `look` may have found a kPassingSight.
  bool any_passing() const { return any_passing_; }
  // Number of candidates that fell back to `look_up` since begin_maps.
  size_t exact_count() const { return exact_count_; }

 private:
  void settle(std::span<const DepthMap> maps, SightTile& tile);

  PlaceView places_;
  PlaceExtent extent_;
  double relative_bias_ = 0.0;
  std::span<const uint8_t> passes_;
  std::vector<PreparedMap> maps_;
  std::vector<float> limits_m_;  // of all maps
  bool any_passing_ = false;
  size_t exact_count_ = 0;
};

}  // namespace sightline
