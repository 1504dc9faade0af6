// Which maps one step takes: how a target's frustum is laid around the bound (paper 3.2, design 4).
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "server/bound/bound.h"
#include "server/sample/depth_map.h"
#include "server/settings/sample_settings.h"

namespace sightline {

inline constexpr int kLeastResolution = 2;  // texels a side, of any map but a sight

// Beyond this half angle one frustum distorts too much: several maps are taken instead.
inline constexpr double kMaxHalfAngleRad = 1.0471975511965976;  // 60 degrees

// Of a cube face in place of one frustum: its texels are about as wide as those of the widest frustum that is still taken alone, so
// that six faces are two maps' work and not six.
int face_resolution(int resolution);

// Appends to `views` the views from `eye_m` that together show every point of the bound: one symmetric frustum that
// just contains it, or up to six 90-degree cube faces (only those that the bound reaches, of face_resolution) when the eye is inside or
// so near that the half angle exceeds kMaxHalfAngleRad. Returns how many were appended (at least 1).
int plan_views(const glm::dvec3& eye_m, const Bound& bound, const SampleSettings& settings,
               const glm::dvec2& jitter, std::vector<MapView>& views);

// Appends the six cube faces around `eye_m`, each of `resolution` texels a side.
void plan_round(const glm::dvec3& eye_m, int resolution, const glm::dvec2& jitter, std::vector<MapView>& views);

// A single-texel view from `eye_m` straight to `place_m`: the exact line of sight to one place, which a map over the whole
// bound knows only to a texel. `place_m` differs from `eye_m`, or the view looks along -Z.
MapView plan_sight(const glm::dvec3& eye_m, const glm::dvec3& place_m);

}  // namespace sightline
