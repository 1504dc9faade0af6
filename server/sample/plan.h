// Plans the maps of a step: the frusta from a target's points around the bound (paper 3.2).
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "server/bound/bound.h"
#include "server/sample/depth_map.h"
#include "server/settings/sample_settings.h"

namespace sightline {

inline constexpr int kLeastResolution = 2;  // texels a side, for maps of more than one texel

// Beyond this half angle one frustum distorts too much: several maps are taken instead.
inline constexpr double kMaxHalfAngleRad = 1.0471975511965976;  // 60 degrees

// The texels a side of a map of the whole bound: settings.resolution, or with a density the cube root of the samples
// that are wanted in the bound, if that is less (paper 3.2).
int map_resolution(const SampleSettings& settings, const Bound& bound);

// The resolution of a cube face that replaces one frustum. Its texels are about as wide as in the widest single
// frustum, so that six faces cost as much as two maps.
int face_resolution(int resolution);

// Appends to `views` the views from `eye_m` that together show every point of the bound, and returns their number (at
// least 1). That is one symmetric frustum that just contains the bound. When the eye is inside the bound, or so near
// that the half angle exceeds kMaxHalfAngleRad, it is the cube faces that the bound reaches. They span 90 degrees and
// have face_resolution.
int plan_views(const glm::dvec3& eye_m, const Bound& bound, const SampleSettings& settings, const glm::dvec2& jitter,
               std::vector<MapView>& views);

// Appends the six cube faces around `eye_m`, each of `resolution` texels a side.
void plan_round(const glm::dvec3& eye_m, int resolution, const glm::dvec2& jitter, std::vector<MapView>& views);

// A single-texel view from `eye_m` to `place_m`. It gives the exact line of sight to one candidate; a map over the
// whole bound gives it only to within a texel. When both points are equal the view looks along -Z.
MapView plan_sight(const glm::dvec3& eye_m, const glm::dvec3& place_m);

}  // namespace sightline
