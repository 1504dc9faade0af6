#include "server/sample/triangle_block.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "server/base/vector_clones.h"

namespace sightline {
namespace {

constexpr float kMargin = static_cast<float>(kSampleMarginTexels);

float least(float a, float b, float c) {
  const float ab = a < b ? a : b;
  return ab < c ? ab : c;
}
float greatest(float a, float b, float c) {
  const float ab = a > b ? a : b;
  return ab > c ? ab : c;
}

// The first and last whole number in [0, end] that lie within `slack` of [low, high], as numbers with a fraction of
// zero.
struct WholeRange {
  float first, last;
};
WholeRange whole_between(float low, float high, float slack, float end) {
  const float first = std::ceil(low - slack), last = std::floor(high + slack);
  return {first > 0.0f ? first : 0.0f, last < end ? last : end};
}

bool same_position(const TriangleBlock& block, int triangle_a, int corner_a, int triangle_b, int corner_b) {
  for (int axis = 0; axis < 3; ++axis)
    if (block.position[corner_a][axis][triangle_a] != block.position[corner_b][axis][triangle_b]) return false;
  return true;
}

// True when edge k of one triangle, from corner k + 1 to k + 2, runs the other way in another triangle.
bool share_edge(const TriangleBlock& block, int triangle, int k, int other) {
  if (triangle == other) return false;
  const int from = (k + 1) % 3, to = (k + 2) % 3;
  for (int j = 0; j < 3; ++j)
    if (same_position(block, triangle, from, other, (j + 2) % 3) &&
        same_position(block, triangle, to, other, (j + 1) % 3))
      return true;
  return false;
}

}  // namespace

void read_triangles(const Geometry& geometry, uint32_t first_index, uint32_t index_count, TriangleBlock& block) {
  block.count = static_cast<int>(index_count / 3);
  const uint32_t* index = geometry.indices.data() + first_index;
  for (int i = 0; i < block.count; ++i)
    for (int corner = 0; corner < 3; ++corner) {
      const glm::vec3& p = geometry.positions[*index++];
      for (int axis = 0; axis < 3; ++axis) block.position[corner][axis][i] = p[axis];
    }
}

SIGHTLINE_VECTOR_CLONES void project_triangles(const SampleGrid& grid, const GridSlack& slack, TriangleBlock& block) {
  const int count = block.count;
  const glm::vec4 to_x = grid.x, to_y = grid.y, to_w = grid.w;  // copies: the block cannot overlap them
  for (int corner = 0; corner < 3; ++corner)
    for (int i = 0; i < count; ++i) {
      const float px = block.position[corner][0][i], py = block.position[corner][1][i],
                  pz = block.position[corner][2][i];
      block.x[corner][i] = to_x.x * px + to_x.y * py + to_x.z * pz + to_x.w;
      block.y[corner][i] = to_y.x * px + to_y.y * py + to_y.z * pz + to_y.w;
      block.w[corner][i] = to_w.x * px + to_w.y * py + to_w.z * pz + to_w.w;
    }
  const float end_x = static_cast<float>(grid.width - 1), end_y = static_cast<float>(grid.height - 1);
  const float near_m = grid.near_m, slack_x = slack.x, slack_y = slack.y, slack_w = slack.w;
  // Outside one side of the samples' pyramid; also valid for a triangle that reaches behind the eye.
  const float wide_x = end_x + kMargin, wide_y = end_y + kMargin;
  const float play_x = slack_x + wide_x * slack_w, play_y = slack_y + wide_y * slack_w;
  alignas(32) int32_t beside[TriangleBlock::kSize];
  for (int i = 0; i < count; ++i) {
    const float x0 = block.x[0][i], x1 = block.x[1][i], x2 = block.x[2][i];
    const float y0 = block.y[0][i], y1 = block.y[1][i], y2 = block.y[2][i];
    const float w0 = block.w[0][i], w1 = block.w[1][i], w2 = block.w[2][i];
    const float left = greatest(x0 + kMargin * w0, x1 + kMargin * w1, x2 + kMargin * w2);
    const float right = least(x0 - wide_x * w0, x1 - wide_x * w1, x2 - wide_x * w2);
    const float below = greatest(y0 + kMargin * w0, y1 + kMargin * w1, y2 + kMargin * w2);
    const float above = least(y0 - wide_y * w0, y1 - wide_y * w1, y2 - wide_y * w2);
    beside[i] = (left < -play_x) | (right > play_x) | (below < -play_y) | (above > play_y);
  }
  for (int i = 0; i < count; ++i) {
    const float w0 = block.w[0][i], w1 = block.w[1][i], w2 = block.w[2][i];
    const float nearest = least(w0, w1, w2) - slack_w, farthest = greatest(w0, w1, w2) + slack_w;
    const bool bounded = nearest >= 0.5f * near_m;
    // 1 keeps the arithmetic finite for unbounded triangles, which do not use it.
    const float v0 = 1.0f / (bounded ? w0 : 1.0f), v1 = 1.0f / (bounded ? w1 : 1.0f), v2 = 1.0f / (bounded ? w2 : 1.0f);
    const float per_depth = 1.0f / (bounded ? nearest : 1.0f);
    const float ax = block.x[0][i] * v0, bx = block.x[1][i] * v1, cx = block.x[2][i] * v2;
    const float ay = block.y[0][i] * v0, by = block.y[1][i] * v1, cy = block.y[2][i] * v2;
    const float low_x = least(ax, bx, cx), high_x = greatest(ax, bx, cx);
    const float low_y = least(ay, by, cy), high_y = greatest(ay, by, cy);
    const float far_x = -low_x > high_x ? -low_x : high_x, far_y = -low_y > high_y ? -low_y : high_y;
    const WholeRange x = whole_between(low_x, high_x, kMargin + (slack_x + far_x * slack_w) * per_depth, end_x);
    const WholeRange y = whole_between(low_y, high_y, kMargin + (slack_y + far_y * slack_w) * per_depth, end_y);
    const bool none = (farthest < near_m) | (bounded & ((x.last < x.first) | (y.last < y.first))) | (beside[i] != 0);
    block.nearest_m[i] = nearest > near_m ? nearest : near_m;
    block.x0[i] = static_cast<int32_t>(none ? 1.0f : bounded ? x.first : 0.0f);
    block.x1[i] = static_cast<int32_t>(none ? 0.0f : bounded ? x.last : end_x);
    block.y0[i] = static_cast<int32_t>(none ? 1.0f : bounded ? y.first : 0.0f);
    block.y1[i] = static_cast<int32_t>(none ? 0.0f : bounded ? y.last : end_y);
  }
}

Cover cover_of(const TriangleBlock& block, int triangle, int sample_x, int sample_y, const GridSlack& slack,
               float near_m) {
  const float sx = static_cast<float>(sample_x), sy = static_cast<float>(sample_y);
  const float rounding = slack.x + slack.y + (sx + sy) * slack.w;
  std::array<float, 3> x, y, w, edge, reach;
  for (int k = 0; k < 3; ++k) {
    w[k] = block.w[k][triangle];
    x[k] = block.x[k][triangle] - w[k] * sx;
    y[k] = block.y[k][triangle] - w[k] * sy;
  }
  Cover out;
  bool inside = true, outside = true;                // certainly, for one orientation of the edges
  bool inside_turned = true, outside_turned = true;  // for the other one
  for (int k = 0; k < 3; ++k) {
    const int a = (k + 1) % 3, b = (k + 2) % 3;
    edge[k] = x[a] * y[b] - y[a] * x[b];
    const float line_x = y[a] * w[b] - w[a] * y[b], line_y = w[a] * x[b] - x[a] * w[b];
    reach[k] = kMargin * std::sqrt(line_x * line_x + line_y * line_y) +
               rounding * (std::abs(x[a]) + std::abs(y[a]) + std::abs(x[b]) + std::abs(y[b]));
    inside &= edge[k] > reach[k];
    outside &= edge[k] >= -reach[k];
    inside_turned &= edge[k] < -reach[k];
    outside_turned &= edge[k] <= reach[k];
    if (std::abs(edge[k]) <= reach[k]) out.near_edges |= 1u << k;
  }
  if (!outside && !outside_turned) return out;
  const float area = edge[0] + edge[1] + edge[2];
  const float shift = reach[0] + reach[1] + reach[2];
  out.low_m = std::max(near_m, least(w[0], w[1], w[2]) - slack.w);
  out.high_m = greatest(w[0], w[1], w[2]) + slack.w;
  if (std::abs(area) > shift) {
    out.turn = area > 0 ? 1 : -1;
    const float depth = (edge[0] * w[0] + edge[1] * w[1] + edge[2] * w[2]) / area;
    // Moved by the margin, the point leans this much more on one corner and less on another.
    float play = slack.w;
    for (int k = 0; k < 3; ++k) play += reach[k] / std::abs(area) * std::abs(w[k] - depth);
    out.low_m = std::max(out.low_m, depth - play);
    out.high_m = std::min(out.high_m, depth + play);
  }
  out.possible = out.high_m >= near_m;
  if (out.low_m <= near_m * (1.0f + kHidingMargin)) out.turn = 0;  // the near plane may cut it
  out.certain = (inside || inside_turned) && out.turn != 0;
  return out;
}

float covered_together_from_m(const TriangleBlock& block, std::span<const SampleCover> covers) {
  float from_m = std::numeric_limits<float>::infinity();
  for (const int turn : {1, -1}) {
    const auto faces = [&](const SampleCover& one) { return one.cover.turn == turn; };
    const auto closed = [&](const SampleCover& one) {
      for (int k = 0; k < 3; ++k) {
        if (!(one.cover.near_edges >> k & 1u)) continue;
        const bool shared = std::any_of(covers.begin(), covers.end(), [&](const SampleCover& other) {
          return faces(other) && share_edge(block, one.triangle, k, other.triangle);
        });
        if (!shared) return false;
      }
      return true;
    };
    float deepest_m = 0.0f;
    bool all_closed = true;
    for (const SampleCover& one : covers) {
      if (!faces(one)) continue;
      deepest_m = std::max(deepest_m, one.cover.high_m);
      all_closed = all_closed && closed(one);
    }
    if (all_closed && deepest_m > 0) from_m = std::min(from_m, deepest_m);
  }
  return from_m;
}

}  // namespace sightline
