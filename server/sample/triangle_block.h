// The triangles of one cluster before the sample points of one map: which may show where, many triangles at a time, and how one of
// them stands to one sample point. Pure functions on the CPU.
#pragma once

#include <cstdint>
#include <span>

#include "server/sample/cull.h"
#include "server/scene/geometry.h"

namespace sightline {

// One array an attribute, so that plain loops run over many triangles at once. Triangle i is [.][i].
struct TriangleBlock {
  static constexpr int kSize = kMaxClusterTriangles;
  int count = 0;
  alignas(32) float position[3][3][kSize];                         // [corner][axis], in the frame of the geometry
  alignas(32) float x[3][kSize], y[3][kSize], w[3][kSize];         // [corner], as SampleGrid has them: not divided by w
  alignas(32) float nearest_m[kSize];                              // depth, not before the near plane
  alignas(32) int32_t x0[kSize], x1[kSize], y0[kSize], y1[kSize];  // samples that it may cover; x1 < x0: none
};

// Reads triangles [first_index, first_index + index_count) of the geometry, at most kSize of them.
void read_triangles(const Geometry& geometry, uint32_t first_index, uint32_t index_count, TriangleBlock& block);

// Projects them and bounds the samples of each. A triangle that reaches behind the near plane has no bounded projection: it may
// cover all. The same bits on every processor.
void project_triangles(const SampleGrid& grid, const GridSlack& slack, TriangleBlock& block);

// How one triangle stands to one sample point. A rasteriser that rounds vertices by less than kSampleMarginTexels covers the
// point for certain, or may cover it; where it does, the depth lies between the two bounds.
struct Cover {
  bool possible = false, certain = false;
  float low_m = 0.0f, high_m = 0.0f;
  // Which way round the corners run as the sample sees them: 1 or -1; 0 when that cannot be told.
  int turn = 0;
  // Bit k: the edge from corner k + 1 to k + 2 (modulo 3) passes within the margin.
  uint32_t near_edges = 0;
};
// Edge functions with the sample point as the origin, as in Woop, Benthin & Wald, "Watertight ray/triangle intersection", 2013;
// taken before the division by w (Olano & Greer, "Triangle scan conversion using 2D homogeneous coordinates", 1997), so that
// what reaches behind the eye is no special case.
Cover cover_of(const TriangleBlock& block, int triangle, int sample_x, int sample_y, const GridSlack& slack,
               float near_m);

// A triangle that may cover a sample.
struct SampleCover {
  uint32_t sample = 0;
  int triangle = 0;  // of the block
  Cover cover;
};
// Neighbours cover together what none covers for certain: `covers` are the triangles of one block that may cover one sample. The
// depth from which on nothing else is seen there, when every edge that passes near the sample joins two of them that face the same
// way; else +infinity. Rasterisers leave no gap between triangles that share two corners.
float covered_together_from_m(const TriangleBlock& block, std::span<const SampleCover> covers);

}  // namespace sightline
