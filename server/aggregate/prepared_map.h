// A depth map as a loop over many places needs it, and the loop: what each place of a tile sees, in single precision, and of which
// places that cannot be told (see look_up.h). Of LookUp alone.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/aggregate/places.h"
#include "server/sample/depth_map.h"

namespace sightline {

// What a place sees of a point.
enum PlaceSight : uint8_t {
  kUnknownSight = 0,  // in no map's window
  kVisibleSight = 1,
  kHiddenSight = 2,
  kPassingSight = 3,  // hidden, by an occluder that may be gone at once
  kUnsureSight = 4,   // to be looked up singly; never in an answer of LookUp
};

// Linear in the place: dot(slope, place) + at_origin.
struct PlaceRow {
  float x = 0, y = 0, z = 0, at_origin = 0;
  float operator()(float px, float py, float pz) const { return x * px + y * py + z * pz + at_origin; }
};

// The texel coordinates, from the middle of texel (0, 0), are across / depth and up / depth.
struct PreparedMap {
  const DepthMap* map = nullptr;
  PlaceRow across, up, depth;
  float eye_x = 0, eye_y = 0, eye_z = 0;  // from the origin
  float last_column = 0, last_row = 0;
  int32_t stride = 0;        // of the limits
  float least_depth = 0;     // twice the error of depth: its sign is right beyond it
  float texel_error = 0;     // over depth: how far a texel coordinate may be off,
  float texel_rounding = 0;  // and this more
  float square_error = 0;    // m^2
  // All places lie well before the eye: then no coordinate is off by more than this.
  bool before = false;
  float greatest_error = 0;
  // By texel, in the list of all prepared maps: the greatest squared distance that sees, m^2. Of a small map in rows of
  // kSmallMap whatever its width, and kSmallMap rows. With `passing` its last bit is 1 where the texel's occluder passes.
  size_t first_limit = 0;
  bool passing = false;
};

// The limits of a map of at most this many texels a side fit the registers.
inline constexpr int kSmallMap = 8;

// `extent` is of all places. `passes`: an entry for each mirror slot, or none. Appends the map's limits to `limits_m2`.
PreparedMap prepare_map(const DepthMap& map, const PlaceExtent& extent, double relative_bias,
                        std::span<const uint8_t> passes, std::vector<float>& limits_m2);

// The sights of a tile's places, which no former map has shown; without `first` there are former maps of the same point, and `sights`
// is what they left. Writes up to kTilePad more. True when one may be kUnsureSight.
bool look_at_map(const PreparedMap& map, const float* limits_m2, const PlaceTile& tile, bool first,
                 uint8_t* sights);

// The same, as it is on machines without AVX-512.
bool look_at_map_plainly(const PreparedMap& map, const float* limits_m2, const PlaceTile& tile, bool first,
                         uint8_t* sights);

}  // namespace sightline
