// A depth map that is prepared for the vectorised look-up of many candidates, and that look-up. It finds what each
// candidate of a tile sees in single precision, and which candidates need double precision (see look_up.h). Used by
// LookUp only.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/aggregate/places.h"
#include "server/sample/depth_map.h"

namespace sightline {

// The visibility of a point from a candidate.
enum PlaceSight : uint8_t {
  kUnknownSight = 0,  // outside the windows of all maps
  kVisibleSight = 1,
  kHiddenSight = 2,
  kPassingSight = 3,  // hidden by an occluder that moves and may soon be gone
  kUnsureSight = 4,   // needs `look_up`; never in a result of LookUp
};

// A linear function of a position: dot(slope, position) + at_origin.
struct PlaceRow {
  float x = 0, y = 0, z = 0, at_origin = 0;
  float operator()(float px, float py, float pz) const { return x * px + y * py + z * pz + at_origin; }
};

// The texel coordinates of a position, relative to the ray of texel (0, 0), are across / depth and up / depth. So the
// nearest ray has the rounded coordinates.
struct PreparedMap {
  const DepthMap* map = nullptr;
  PlaceRow across, up, depth;
  float last_column = 0, last_row = 0;
  // A position is inside the window when |across / depth * per_half_width - middle_x| < 1, and likewise for the rows.
  float per_half_width = 0, middle_x = 0, per_half_height = 0, middle_y = 0;
  int32_t stride = 0;     // limits in a row
  float least_depth = 0;  // twice the error of depth; a depth of larger size has the right sign
  float texel_error = 0;  // the error of a texel coordinate is at most texel_error / depth + texel_rounding
  float texel_rounding = 0;
  float per_half = 0;     // the greater of per_half_width and per_half_height
  float limit_error = 0;  // the error of the difference of a depth and a limit near it, metres
  // All positions are well in front of the eye. Then no texel coordinate has a larger error than greatest_error.
  bool before = false;
  float greatest_error = 0;
  // Index of the map's first limit in the list for all maps. The limit of a texel is the greatest depth that sees,
  // metres. A small map has kSmallMap rows of kSmallMap limits. If `passing`, the last bit of a limit is 1 where the
  // texel's occluder passes.
  size_t first_limit = 0;
  bool passing = false;
};

// The limits of a map with at most this many texels on each side fit into vector registers.
inline constexpr int kSmallMap = 8;

// Prepares a map for positions within `extent`, and appends its limits to `limits_m`. `passes` has an entry for each
// mirror slot, or is empty.
PreparedMap prepare_map(const DepthMap& map, const PlaceExtent& extent, double relative_bias,
                        std::span<const uint8_t> passes, std::vector<float>& limits_m);

// Writes the sights of a tile's candidates, and up to kTilePad bytes more. Unless `first`, `sights` holds the result of
// earlier maps of the same point, and only unknown sights are replaced. Returns whether a sight may be kUnsureSight.
bool look_at_map(const PreparedMap& map, const float* limits_m, const PlaceTile& tile, bool first, uint8_t* sights);

// The same without AVX-512 intrinsics.
bool look_at_map_plainly(const PreparedMap& map, const float* limits_m, const PlaceTile& tile, bool first,
                         uint8_t* sights);

}  // namespace sightline
