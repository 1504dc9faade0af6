// Coherence (paper 6.2): how well a camera keeps its shot. The paper measures the mean deviation of property satisfaction, and the sum of the camera's
// accelerations.
//
// The shot that was asked for is the one of the first frame. It has four properties. Side and height are those from which the camera sees the targets' centre, in
// the world. Size and place are those of the centre in the picture. A property is satisfied within a free band around
// its value in the first frame, and from a limit on not at all. Between the two the deviation rises from 0 to 1 in proportion. A cut does not change what was asked
// for.
#pragma once

#include <span>

#include "client/truth/judge.h"

namespace sightline {

// Where a deviation begins, and where it is 1.
struct FreeBand {
  double free = 0.0, limit = 1.0;
};
inline constexpr FreeBand kSideBandRad{0.5235987755982988, 2.0943951023931953};    // 30 and 120 degrees
inline constexpr FreeBand kHeightBandRad{0.17453292519943295, 0.7853981633974483};  // 10 and 45 degrees
inline constexpr double kHighRad = 1.0471975511965976;  // 60 degrees: from there on, a picture shows heads and shoulders only
inline constexpr FreeBand kSizeBandLog2{0.25, 1.5};
inline constexpr FreeBand kPlaceBandHalfPictures{0.15, 1.0};

// The properties of one frame. Side and height are the azimuth and elevation of the camera as seen from the targets' centre.
struct ShotProperties {
  double side_rad = 0.0, height_rad = 0.0;
  double size_log2 = 0.0;          // of one over the picture's height at the centre, in metres
  glm::dvec2 place_half_pictures{0.0};  // of the centre from the picture's middle, right and up; infinite if it is behind the camera
};
ShotProperties shot_properties(const CameraFrame& frame, const glm::dvec3& center_m);

// Deviations from the asked shot, each in [0, 1].
struct ShotDeviation {
  double side = 0.0, height = 0.0, size = 0.0, place = 0.0;
  double mean() const { return (side + height + size + place) / 4; }
};
ShotDeviation deviation_between(const ShotProperties& asked, const ShotProperties& now);

struct CoherenceMetrics {
  ShotDeviation mean;       // over the frames
  double kept_share = 0.0;  // of the frames in which no property deviates by more than half, [0, 1]
  // Elevations of the camera over the targets' centre: the first frame's, the median over the frames, and the share of them above kHighRad.
  double asked_height_rad = 0.0, median_height_rad = 0.0, high_share = 0.0;
  // The sum of the changes of the camera's velocity between neighbouring frames, over the time of the run. Frames at a declared jump of
  // the camera are left out.
  double mean_acceleration_mps2 = 0.0;
};
// `centers_m`: the weighted centre of the targets at each frame; world, as long as `frames`. All 0 without frames.
CoherenceMetrics coherence_of(std::span<const CameraFrame> frames, std::span<const glm::dvec3> centers_m);

}  // namespace sightline
