// Tests the triangles of one cluster against the sample points of one map. It first finds the samples that each
// triangle may cover, for many triangles at a time. Then it tests one triangle at one sample exactly. Pure functions on
// the CPU.
#pragma once

#include <cstdint>
#include <span>

#include "server/sample/cull.h"
#include "server/scene/geometry.h"

namespace sightline {

// One array for each attribute, so that plain loops handle many triangles at once. Triangle i is [.][i].
struct TriangleBlock {
  static constexpr int kSize = kMaxClusterTriangles;
  int count = 0;
  alignas(32) float position[3][3][kSize];  // [corner][axis], in the frame of the geometry
  alignas(32) float x[3][kSize], y[3][kSize],
      w[3][kSize];                                                 // [corner], as in SampleGrid: not divided by w
  alignas(32) float nearest_m[kSize];                              // at least the depth of the near plane
  alignas(32) int32_t x0[kSize], x1[kSize], y0[kSize], y1[kSize];  // samples that it may cover; none when x1 < x0
};

// Reads triangles [first_index, first_index + index_count) of the geometry, at most kSize of them.
void read_triangles(const Geometry& geometry, uint32_t first_index, uint32_t index_count, TriangleBlock& block);

// Projects the triangles and bounds the samples of each. A triangle that reaches behind the near plane has no bounded
// projection: it may cover all samples. Gives the same bits on every processor.
void project_triangles(const SampleGrid& grid, const GridSlack& slack, TriangleBlock& block);

// One triangle at one sample point. `certain`: every rasteriser that rounds vertices by less than kSampleMarginTexels
// covers the point; `possible`: one may. The depth then lies between the two bounds.
struct Cover {
  bool possible = false, certain = false;
  float low_m = 0.0f, high_m = 0.0f;
  // The orientation of the corners as the sample sees them: 1 or -1; 0 when rounding leaves it open.
  int turn = 0;
  // Bit k: the edge from corner k + 1 to k + 2 (modulo 3) passes within the margin.
  uint32_t near_edges = 0;
};
// Uses edge functions with the sample point as the origin (Woop, Benthin & Wald, "Watertight ray/triangle
// intersection", 2013). They are evaluated before the division by w, so that a triangle that reaches behind the eye is
// no special case (Olano & Greer, "Triangle scan conversion using 2D homogeneous coordinates", 1997).
Cover cover_of(const TriangleBlock& block, int triangle, int sample_x, int sample_y, const GridSlack& slack,
               float near_m);

// A triangle that may cover a sample.
struct SampleCover {
  uint32_t sample = 0;
  int triangle = 0;  // of the block
  Cover cover;
};
// Neighbours may together cover a sample that none covers for certain, since rasterisers leave no gap between triangles
// that share two corners. `covers` are the triangles of one block that may cover one sample. Returns the depth beyond
// which nothing else is seen there when every edge near the sample joins two of them with the same orientation;
// otherwise +infinity.
float covered_together_from_m(const TriangleBlock& block, std::span<const SampleCover> covers);

}  // namespace sightline
