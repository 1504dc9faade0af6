#include "server/aggregate/prepared_map.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>

#include "server/base/vector_clones.h"

#ifdef SIGHTLINE_X86_V4
#include <immintrin.h>
// GCC 12 warns about operands that its own intrinsics leave undefined (GCC bug 105593).
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#pragma GCC diagnostic ignored "-Wuninitialized"
#endif

namespace sightline {
namespace {

// Relative rounding error of one operation in single precision.
constexpr double kRounding = 0x1p-24;
// A sum of four products of rounded factors has an error of at most 6 roundings of the sum of their sizes.
constexpr double kSumError = 8 * kRounding;
// All positions are well in front of the eye when the depth of the nearest is at least this share of the middle's
// depth.
constexpr double kWellBefore = 0.2;

// The greatest error of a row over the positions, see kSumError.
double error_of(const glm::dvec3& slope, double at_origin, const glm::dvec3& reach_m) {
  return kSumError * (glm::dot(glm::abs(slope), reach_m) + std::abs(at_origin));
}

PlaceRow row_of(const glm::dvec3& slope, double at_origin) {
  return {static_cast<float>(slope.x), static_cast<float>(slope.y), static_cast<float>(slope.z),
          static_cast<float>(at_origin)};
}

// Let d be the computed depth and at least twice its error e_d. A true texel coordinate t and the computed one c differ
// by |c - t| <= (e_x + |t| e_d) / d, so by at most 2 (e_x + size e_d) / d if one of them is in the window.
void set_rows(const MapView& view, const PlaceExtent& extent, PreparedMap& out) {
  const glm::dvec3 eye = view.eye_m - extent.middle_m, back = view.world_from_view[2];
  const double per_width = view.width / (view.right - view.left), per_height = view.height / (view.top - view.bottom);
  const glm::dvec3 across = (view.world_from_view[0] + view.left * back) * per_width + view.jitter.x * back,
                   up = (view.world_from_view[1] + view.bottom * back) * per_height + view.jitter.y * back;
  const double across_0 = -glm::dot(across, eye), up_0 = -glm::dot(up, eye), depth_0 = glm::dot(back, eye);
  const double depth_error = error_of(back, depth_0, extent.reach_m);
  // The sum, not the maximum, because a sum stays NaN when one of them is.
  const double coordinate_error = error_of(across, across_0, extent.reach_m) + error_of(up, up_0, extent.reach_m) +
                                  std::fmax(view.width, view.height) * depth_error;
  out.across = row_of(across, across_0), out.up = row_of(up, up_0), out.depth = row_of(-back, depth_0);
  out.last_column = static_cast<float>(view.width - 1), out.last_row = static_cast<float>(view.height - 1);
  out.per_half_width = 2.0f / static_cast<float>(view.width),
  out.per_half_height = 2.0f / static_cast<float>(view.height);
  out.middle_x = static_cast<float>(1 - 2 * view.jitter.x / view.width),
  out.middle_y = static_cast<float>(1 - 2 * view.jitter.y / view.height);
  out.per_half = std::fmax(out.per_half_width, out.per_half_height);
  out.least_depth = static_cast<float>(2.1 * depth_error);
  out.texel_error = static_cast<float>(2.1 * coordinate_error);
  out.texel_rounding = static_cast<float>(16 * kRounding * std::fmax(view.width, view.height));
  // The limit and its last bit add three roundings, less than half of the depth's error.
  out.limit_error = static_cast<float>(2 * depth_error);
  const double nearest = depth_0 - extent.radius_m - depth_error;
  out.before = nearest > kWellBefore * depth_0 && nearest > 4 * depth_error;
  out.greatest_error = static_cast<float>(1.01 * out.texel_error / nearest + out.texel_rounding);
}

// The squares of the columns' or rows' offsets from the view axis, at one unit of depth.
using Squares = std::array<double, kMaxMapSize>;
void set_squares(double low, double high, double jitter, int count, Squares& squares) {
  for (int i = 0; i < count; ++i) {
    const double offset = low + (i + jitter) / count * (high - low);
    squares[static_cast<size_t>(i)] = offset * offset;
  }
}

SIGHTLINE_VECTOR_CLONES
void set_limit_row(const float* __restrict distance_m, const double* __restrict squares, double square, int width,
                   double slack, float* __restrict limits_m) {
  for (int x = 0; x < width; ++x)
    limits_m[x] = static_cast<float>(distance_m[x] * slack / std::sqrt(1.0 + square + squares[x]));
}

void set_limits(const DepthMap& map, double slack, int stride, float* limits_m) {
  const MapView& view = map.view;
  Squares columns, rows;
  set_squares(view.left, view.right, view.jitter.x, view.width, columns);
  set_squares(view.bottom, view.top, view.jitter.y, view.height, rows);
  for (int y = 0; y < view.height; ++y)
    set_limit_row(&map.distance_m[static_cast<size_t>(y * view.width)], columns.data(), rows[static_cast<size_t>(y)],
                  view.width, slack, limits_m + y * stride);
}

// Returns whether any texel's occluder passes, and if so marks those texels in the last bits of their limits. Infinite
// limits hide nothing and stay as they are, because another last bit would make them NaN.
bool set_passing(const DepthMap& map, std::span<const uint8_t> passes, int32_t stride, float* limits_m) {
  const auto of_texel = [&](size_t texel) {
    const uint32_t occluder = map.occluder[texel];
    return occluder != kNoOccluder && passes[occluder] != 0 && !std::isinf(map.distance_m[texel]);
  };
  bool any = false;
  for (size_t texel = 0; texel < map.occluder.size() && !any; ++texel) any = of_texel(texel);
  if (!any) return false;
  for (int y = 0; y < map.view.height; ++y)
    for (int x = 0; x < map.view.width; ++x) {
      float& limit_m = limits_m[y * stride + x];
      const bool passing = of_texel(static_cast<size_t>(y * map.view.width + x));
      if (!std::isinf(limit_m)) limit_m = std::bit_cast<float>((std::bit_cast<uint32_t>(limit_m) & ~1u) | passing);
    }
  return true;
}

// A sight is certain only if a comparison holds, so NaN never gives a certain sight.
template <bool kPasses>
[[gnu::always_inline]] inline bool look(const PreparedMap& map, const float* __restrict limits_m, const PlaceTile& tile,
                                        bool first, uint8_t* __restrict sights) {
  int32_t any_unsure = 0;
  const int32_t former = first ? 0 : 0xFF;
  for (size_t i = 0; i < tile.count; ++i) {
    const float px = tile.x_m[i], py = tile.y_m[i], pz = tile.z_m[i];
    const float depth = map.depth(px, py, pz), per_depth = 1.0f / depth;
    const float x = map.across(px, py, pz) * per_depth, y = map.up(px, py, pz) * per_depth;
    const float error = map.texel_error * per_depth + map.texel_rounding;
    // Clamped, so that the texel is always inside the map.
    const float in_x = x > 0.0f ? x : 0.0f, in_y = y > 0.0f ? y : 0.0f;
    const auto column = static_cast<int32_t>((in_x < map.last_column ? in_x : map.last_column) + 0.5f),
               row = static_cast<int32_t>((in_y < map.last_row ? in_y : map.last_row) + 0.5f);
    // From the middle of the window to its edge, 1; and the coordinate's distance from where the nearest ray changes.
    const float off_x = std::abs(x * map.per_half_width - map.middle_x),
                off_y = std::abs(y * map.per_half_height - map.middle_y);
    const float off = off_x > off_y ? off_x : off_y;
    const float change_x = std::abs(std::abs(x - static_cast<float>(column)) - 0.5f),
                change_y = std::abs(std::abs(y - static_cast<float>(row)) - 0.5f);
    const float change = change_x < change_y ? change_x : change_y;
    const float limit_m = limits_m[row * map.stride + column];
    const float over = depth - limit_m;

    const bool before = depth > map.least_depth, behind = depth < -map.least_depth;
    const float edge_error = error * map.per_half;
    const bool inside = before & (off < 1.0f - edge_error) & (change > error),
               beside = before & (off > 1.0f + edge_error);
    const int32_t hidden = kPasses ? kHiddenSight + (std::bit_cast<int32_t>(limit_m) & 1) : kHiddenSight;
    int32_t sight = behind | beside ? kUnknownSight : kUnsureSight;
    sight = inside & (over < -map.limit_error) ? kVisibleSight : sight;
    sight = inside & (over > map.limit_error) ? hidden : sight;
    const int32_t before_this = sights[i] & former;
    sight = before_this == kUnknownSight ? sight : before_this;
    any_unsure |= sight & kUnsureSight;
    sights[i] = static_cast<uint8_t>(sight);
  }
  return any_unsure != 0;
}

SIGHTLINE_VECTOR_CLONES
bool look_plainly(const PreparedMap& map, const float* limits_m, const PlaceTile& tile, bool first, uint8_t* sights) {
  return look<false>(map, limits_m, tile, first, sights);
}

SIGHTLINE_VECTOR_CLONES
bool look_plainly_passing(const PreparedMap& map, const float* limits_m, const PlaceTile& tile, bool first,
                          uint8_t* sights) {
  return look<true>(map, limits_m, tile, first, sights);
}

#ifdef SIGHTLINE_X86_V4

struct RowV4 {
  __m512 x, y, z, at_origin;
};

SIGHTLINE_X86_V4 inline RowV4 spread(const PlaceRow& row) {
  return {_mm512_set1_ps(row.x), _mm512_set1_ps(row.y), _mm512_set1_ps(row.z), _mm512_set1_ps(row.at_origin)};
}

SIGHTLINE_X86_V4 inline __m512 at(const RowV4& row, __m512 px, __m512 py, __m512 pz) {
  return _mm512_fmadd_ps(row.x, px, _mm512_fmadd_ps(row.y, py, _mm512_fmadd_ps(row.z, pz, row.at_origin)));
}

// The texel's coordinate on one axis, clamped to the map. min and max return the second operand for NaN.
SIGHTLINE_X86_V4 inline __m512i texel_at(__m512 coordinate, __m512 last) {
  return _mm512_cvtps_epi32(_mm512_min_ps(_mm512_max_ps(coordinate, _mm512_setzero_ps()), last));
}

// The distance from the nearest of ..., -0.5, 0.5, 1.5, ..., with a sign. The last argument asks for the rest beside
// the nearest integer.
SIGHTLINE_X86_V4 inline __m512 from_half(__m512 coordinate) {
  return _mm512_reduce_ps(_mm512_add_ps(coordinate, _mm512_set1_ps(0.5f)), 0);
}

// The limits of a small map are in four registers, where reading one costs a tenth of reading memory.
template <bool kSmall, bool kBefore, bool kPasses>
SIGHTLINE_X86_V4 bool look_v4(const PreparedMap& map, const float* limits_m, const PlaceTile& tile, bool first,
                              uint8_t* sights) {
  const RowV4 across = spread(map.across), up = spread(map.up), depth_row = spread(map.depth);
  const __m512 last_column = _mm512_set1_ps(map.last_column), last_row = _mm512_set1_ps(map.last_row),
               least_depth = _mm512_set1_ps(map.least_depth), limit_error = _mm512_set1_ps(map.limit_error),
               less_limit_error = _mm512_set1_ps(-map.limit_error), whole = _mm512_set1_ps(1.0f),
               per_half = _mm512_set1_ps(map.per_half);
  const __m512 per_half_width = _mm512_set1_ps(map.per_half_width), middle_x = _mm512_set1_ps(map.middle_x),
               per_half_height = _mm512_set1_ps(map.per_half_height), middle_y = _mm512_set1_ps(map.middle_y);
  const __m512i stride = _mm512_set1_epi32(map.stride), one = _mm512_set1_epi32(1);
  const __m512 limits_0 = _mm512_loadu_ps(limits_m), limits_1 = kSmall ? _mm512_loadu_ps(limits_m + 16) : limits_0,
               limits_2 = kSmall ? _mm512_loadu_ps(limits_m + 32) : limits_0,
               limits_3 = kSmall ? _mm512_loadu_ps(limits_m + 48) : limits_0;
  __m512 error = _mm512_set1_ps(map.greatest_error), within = _mm512_set1_ps(1.0f - map.greatest_error * map.per_half),
         without = _mm512_set1_ps(1.0f + map.greatest_error * map.per_half);
  __mmask16 any_unsure = 0;
  for (size_t i = 0; i < tile.count; i += PlaceTile::kTilePad) {
    const __m512 px = _mm512_load_ps(tile.x_m + i), py = _mm512_load_ps(tile.y_m + i),
                 pz = _mm512_load_ps(tile.z_m + i);
    const __m512 depth = at(depth_row, px, py, pz), per_depth = _mm512_div_ps(_mm512_set1_ps(1.0f), depth);
    const __m512 x = _mm512_mul_ps(at(across, px, py, pz), per_depth), y = _mm512_mul_ps(at(up, px, py, pz), per_depth);
    const __m512i column = texel_at(x, last_column), row = texel_at(y, last_row);
    // The greater of the distances from the window's middle, and the smaller of those from where the nearest ray
    // changes, along either axis.
    const __m512 off = _mm512_range_ps(_mm512_fmsub_ps(x, per_half_width, middle_x),
                                       _mm512_fmsub_ps(y, per_half_height, middle_y), 0b1011),
                 change = _mm512_range_ps(from_half(x), from_half(y), 0b1010);
    __m512 limit_m;
    if constexpr (kSmall) {
      const __m512i texel = _mm512_add_epi32(_mm512_slli_epi32(row, 3), column);
      limit_m = _mm512_mask_mov_ps(_mm512_permutex2var_ps(limits_0, texel, limits_1),
                                   _mm512_test_epi32_mask(texel, _mm512_set1_epi32(32)),
                                   _mm512_permutex2var_ps(limits_2, texel, limits_3));
    } else {
      limit_m = _mm512_i32gather_ps(_mm512_add_epi32(_mm512_mullo_epi32(row, stride), column), limits_m, 4);
    }
    const __m512 over = _mm512_sub_ps(depth, limit_m);

    __mmask16 before = 0xFFFF, elsewhere = 0;
    if constexpr (!kBefore) {
      error = _mm512_fmadd_ps(_mm512_set1_ps(map.texel_error), per_depth, _mm512_set1_ps(map.texel_rounding));
      const __m512 edge_error = _mm512_mul_ps(error, per_half);
      within = _mm512_sub_ps(whole, edge_error), without = _mm512_add_ps(whole, edge_error);
      before = _mm512_cmp_ps_mask(depth, least_depth, _CMP_GT_OQ);
      elsewhere = _mm512_cmp_ps_mask(depth, _mm512_sub_ps(_mm512_setzero_ps(), least_depth), _CMP_LT_OQ);
    }
    const __mmask16 inside = _mm512_mask_cmp_ps_mask(_mm512_mask_cmp_ps_mask(before, change, error, _CMP_GT_OQ), off,
                                                     within, _CMP_LT_OQ);
    elsewhere |= _mm512_mask_cmp_ps_mask(before, off, without, _CMP_GT_OQ);
    const __mmask16 visible = _mm512_mask_cmp_ps_mask(inside, over, less_limit_error, _CMP_LT_OQ),
                    hidden = _mm512_mask_cmp_ps_mask(inside, over, limit_error, _CMP_GT_OQ);
    auto unsure = static_cast<__mmask16>(~(visible | hidden | elsewhere));
    __m128i sight = _mm_maskz_set1_epi8(visible, kVisibleSight);
    sight = _mm_mask_mov_epi8(sight, hidden, _mm_set1_epi8(kHiddenSight));
    if constexpr (kPasses)
      sight = _mm_mask_mov_epi8(sight, _mm512_mask_test_epi32_mask(hidden, _mm512_castps_si512(limit_m), one),
                                _mm_set1_epi8(kPassingSight));
    sight = _mm_mask_mov_epi8(sight, unsure, _mm_set1_epi8(kUnsureSight));
    auto* const out = reinterpret_cast<__m128i*>(sights + i);
    if (!first) {
      const __m128i former = _mm_loadu_si128(out);
      const __mmask16 open = _mm_testn_epi8_mask(former, former);
      sight = _mm_mask_mov_epi8(former, open, sight);
      unsure &= open;
    }
    _mm_storeu_si128(out, sight);
    any_unsure |= unsure;
  }
  return any_unsure != 0;
}

template <bool kSmall>
SIGHTLINE_X86_V4 bool look_v4(const PreparedMap& map, const float* limits_m, const PlaceTile& tile, bool first,
                              uint8_t* sights) {
  if (map.before)
    return map.passing ? look_v4<kSmall, true, true>(map, limits_m, tile, first, sights)
                       : look_v4<kSmall, true, false>(map, limits_m, tile, first, sights);
  return map.passing ? look_v4<kSmall, false, true>(map, limits_m, tile, first, sights)
                     : look_v4<kSmall, false, false>(map, limits_m, tile, first, sights);
}

#endif

bool is_small(const MapView& view) {
  return view.width <= kSmallMap && view.height <= kSmallMap;
}

}  // namespace

PreparedMap prepare_map(const DepthMap& map, const PlaceExtent& extent, double relative_bias,
                        std::span<const uint8_t> passes, std::vector<float>& limits_m) {
  PreparedMap out;
  out.map = &map;
  set_rows(map.view, extent, out);
  const bool small = is_small(map.view);
  out.stride = small ? kSmallMap : map.view.width;
  out.first_limit = limits_m.size();
  // Limits that are not set are never used. There are at least 16, because whole vectors are read.
  const size_t count = small ? kSmallMap * kSmallMap : std::max<size_t>(map.distance_m.size(), 16);
  limits_m.resize(out.first_limit + count);
  float* const limits = &limits_m[out.first_limit];
  set_limits(map, 1.0 + relative_bias, out.stride, limits);
  out.passing = !passes.empty() && set_passing(map, passes, out.stride, limits);
  return out;
}

bool look_at_map_plainly(const PreparedMap& map, const float* limits_m, const PlaceTile& tile, bool first,
                         uint8_t* sights) {
  limits_m += map.first_limit;
  return map.passing ? look_plainly_passing(map, limits_m, tile, first, sights)
                     : look_plainly(map, limits_m, tile, first, sights);
}

bool look_at_map(const PreparedMap& map, const float* limits_m, const PlaceTile& tile, bool first, uint8_t* sights) {
#ifdef SIGHTLINE_X86_V4
  static const bool v4 = runs_x86_v4();
  if (v4) {
    limits_m += map.first_limit;
    return is_small(map.map->view) ? look_v4<true>(map, limits_m, tile, first, sights)
                                   : look_v4<false>(map, limits_m, tile, first, sights);
  }
#endif
  return look_at_map_plainly(map, limits_m, tile, first, sights);
}

}  // namespace sightline
