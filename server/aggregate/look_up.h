// Looking places up in depth maps: does a place see the point from which a map was taken? For one place exactly as said
// (`look_up`), and for many at once with the very same answers (`LookUp`).
//
// Many at once are looked up in single precision: one division a place and map instead of four and a root, eight or sixteen
// places an instruction. Every number goes with a bound of its rounding error; where an answer could hang on it (a place within
// that of a texel's edge, of the eye's plane, or of the texel's distance: some in 10,000) the place is looked up again by
// `look_up`. This is the floating-point filter of exact geometric predicates (Fortune & Van Wyk, "Static analysis yields
// efficient exact integer arithmetic for computational geometry", 1996; Shewchuk, "Adaptive precision floating-point
// arithmetic", 1997).
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "server/aggregate/places.h"
#include "server/aggregate/prepared_map.h"
#include "server/sample/depth_map.h"

namespace sightline {

// Where one map shows a point: its texel, or nothing.
struct Sight {
  bool known = false;               // the point lies in the window of one of the maps
  bool visible = false;             // and nothing stands between
  uint32_t occluder = kNoOccluder;  // what does, when not visible
};

// Whether `point_m` sees the point from which the maps were taken: its distance is compared with the texel's. At
// equality it is visible; an unknown point is not.
Sight look_up(std::span<const DepthMap> maps, const glm::dvec3& point_m, double relative_bias);

// A tile of places and what they see. Scratch memory, 13 KiB, to be kept on the stack: that of a thread is warm where that of one of
// many sessions is not.
struct SightTile {
  PlaceTile places;
  uint8_t sights[kTilePlaces + PlaceTile::kTilePad];
};

// Places, looked up a tile at a time in one point's maps after the other's: while a tile is in the nearest cache, all maps are. In turn:
//
//   set_places(places); begin_maps(bias, passes); first = add_maps(of a point) ...;
//   load_tile(0, tile); look(first, count, tile) ...; load_tile(1, tile) ...
//
// Memory is kept from call to call. Not thread-safe. Deterministic; the same on every machine.
class LookUp {
 public:
  // The places of the calls to come; what the view refers to must outlive them.
  void set_places(const PlaceView& places);
  size_t size() const { return places_.size(); }
  size_t tile_count() const { return (size() + kTilePlaces - 1) / kTilePlaces; }

  // Other maps are to come, for relative_bias in [0, 0.1]. `passes` has an entry for each mirror slot: 1 for occluders that may be gone
  // at once; empty: none. Must outlive the looks.
  void begin_maps(double relative_bias, std::span<const uint8_t> passes = {});
  // All maps of one point; they must outlive the looks. Returns the number of the first.
  size_t add_maps(std::span<const DepthMap> maps);

  void load_tile(size_t number, SightTile& tile) const;
  // A PlaceSight by place of the tile: what `look_up` says of it in these maps, all of one point. Valid until the tile's next use.
  std::span<const uint8_t> look(size_t first_map, size_t count, SightTile& tile);
  // Whether the last look may have found a kPassingSight.
  bool any_passing() const { return any_passing_; }
  // How many places the looks since begin_maps looked up singly.
  size_t exact_count() const { return exact_count_; }

 private:
  void settle(std::span<const DepthMap> maps, SightTile& tile);

  PlaceView places_;
  PlaceExtent extent_;
  double relative_bias_ = 0.0;
  std::span<const uint8_t> passes_;
  std::vector<PreparedMap> maps_;
  std::vector<float> limits_m2_;  // of all maps
  bool any_passing_ = false;
  size_t exact_count_ = 0;
};

}  // namespace sightline
