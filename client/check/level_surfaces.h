// Walls that are too thin, and surfaces that have one side only: found by rays from evenly spread places on the
// surfaces into what they enclose.
#pragma once

#include <string>
#include <vector>

#include "client/check/level.h"

namespace sightline {

// A thinner wall does not hide reliably. A depth map ignores what is nearer than 1 cm to a point of a target
// (kMapNearM), and counts a camera as seeing up to 0.1 % of the depth behind a surface (Settings' relative_bias), which
// is 2 cm at 20 m.
inline constexpr double kThinnestWallM = 0.02;
// An instance is named from this area on, both sides counted, if it is a quarter of what was judged of the instance.
// Less hides no person.
inline constexpr double kLeastNamedM2 = 2.0;

struct SurfaceFinding {
  std::string name;  // of the instance's node
  double area_m2 = 0.0;
};

// Both lists are sorted by area, the largest first. Nodes of one name are one entry.
struct SurfaceFindings {
  // Upright surfaces whose other side is nearer than kThinnestWallM. A double-sided plane counts: it is its own other
  // side.
  std::vector<SurfaceFinding> thin;
  // Surfaces without another side that an engine draws from the front alone, though here they hide from both. Floors
  // and ground do not count: nobody looks at them from below.
  std::vector<SurfaceFinding> one_sided;
};

// Judges what hides and does not move. Deterministic.
SurfaceFindings surface_findings(const Level& level);

}  // namespace sightline
