// What a picture is worth, from 0 to 1: 1 is the shot that was asked for, with everybody whole in it (paper 6.2:
// coherence, the visual properties of a shot maintained over time).
//
//   worth = 1 - sight loss - shot loss, at least 0
//
// The sight loss is the share of the targets that the picture lacks, hidden or cut off at its edge. The shot loss is
// the weighted sum of how far the picture departs from the shot: another height, side or size, or another place in the
// picture. Within a free band a property loses nothing. At the limit it has lost all of its weight; between the two the
// loss rises in proportion.
//
// One function serves the judge of pictures, the search for viewpoints and the flight plan. The plan needs a way back
// from beyond the limit, so there a deviation goes on beyond 1 at the same rate.
#pragma once

#include <cstddef>
#include <glm/glm.hpp>

#include "server/settings/move_settings.h"

namespace sightline {

struct FreeBand {
  double free = 0.0, limit = 1.0;
};
inline constexpr FreeBand kSideBandRad{0.5235987755982988, 2.0943951023931953};     // 30 and 120 degrees
inline constexpr FreeBand kHeightBandRad{0.17453292519943295, 0.7853981633974483};  // 10 and 45 degrees
inline constexpr FreeBand kSizeBandLog2{0.25, 1.5};                                 // of the ratio of the sizes
inline constexpr FreeBand kPlaceBandHalfPictures{0.15, 1.0};

// The properties of a shot of some targets, as seen from their centre: the azimuth and the elevation of the camera, and
// the size of things at the centre in the picture.
struct ShotProperties {
  double side_rad = 0.0, height_rad = 0.0;
  // false right above and below; from 60 degrees of elevation on, the side counts less and less
  bool has_side = true;
  double size_log2 = 0.0;  // of one over the picture's height at the centre, in metres
  // of the centre from the picture's middle, right and up; infinite if it is behind the camera
  glm::dvec2 place_half_pictures{0.0};
};
// From `offset_m`, from the centre to the camera, world axes. The centre is taken to be in the middle of the picture.
ShotProperties shot_from(const glm::dvec3& offset_m, double vertical_fov_rad);

// >= 0; 1 at the limit, and more beyond it.
struct ShotDeviation {
  double side = 0.0, height = 0.0, size = 0.0, place = 0.0;
};
// `tolerance`, [0, 3]: how wide the free bands are, 1 as above. The limits stay.
ShotDeviation deviation_between(const ShotProperties& asked, const ShotProperties& now, double tolerance = 1.0);

// The same, each deviation at most 1.
ShotDeviation up_to_limits(const ShotDeviation& deviation);

// True if side, height and size lose nothing.
inline bool within_free_bands(const ShotDeviation& deviation) {
  return deviation.side <= 0 && deviation.height <= 0 && deviation.size <= 0;
}

// The weighted sum of the deviations: up to their limits, or as far as they go.
double shot_loss(const ShotDeviation& deviation, const ShotWeights& weights);
double unbounded_shot_loss(const ShotDeviation& deviation, const ShotWeights& weights);

// [0, 1]
double picture_worth(double sight_loss, double shot_loss);

// Many places at once: unbounded_shot_loss of side, height and size for each of `count` places, relative to the
// targets' centre. `asked_m`: the asked offset from the centre to the camera, not zero; the lens is the same at all
// places. Within 2e-3 of the function above. Deterministic.
struct ShotPlaces {
  const float *x_m, *y_m, *z_m;  // from any origin
  size_t count;
  glm::vec3 center_m;  // from the same origin
};
void unbounded_shot_losses(const ShotPlaces& places, const glm::dvec3& asked_m, const ShotWeights& weights,
                           float* losses, double tolerance = 1.0);

}  // namespace sightline
