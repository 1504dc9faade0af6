// Coherence (paper 6.2): how well a camera keeps its shot. The paper measures the mean deviation of property
// satisfaction, and the sum of the camera's accelerations.
//
// The shot that was asked for is the one of the first frame, or one that a client asked for (asked_frames.h). Its
// properties, their free bands and their limits are those of picture_worth.h. A cut does not change what was asked for.
#pragma once

#include <span>

#include "client/truth/judge.h"
#include "server/move/picture_worth.h"

namespace sightline {

// 60 degrees: from there on, a picture shows heads and shoulders only
inline constexpr double kHighRad = 1.0471975511965976;

// The properties of one frame.
ShotProperties shot_properties(const CameraFrame& frame, const glm::dvec3& center_m);

// The properties that were asked for at a frame, and those that the frame has.
struct FrameShot {
  ShotProperties asked, now;
};

// The shot of the first frame, asked for at each. `centers_m`: the weighted centre of the targets at each frame; world,
// as long as `frames`.
std::vector<FrameShot> shots_as_begun(std::span<const CameraFrame> frames, std::span<const glm::dvec3> centers_m);

// The mean of the four deviations, and the largest.
double mean_of(const ShotDeviation& deviation);
double largest_of(const ShotDeviation& deviation);
// A frame keeps its shot while no property deviates by more than this.
inline constexpr double kKeptDeviation = 0.5;

// What a picture lacks of the targets' whole bodies, [0, 1], hidden and cut off alike (see add_outlines). Each target
// loses nothing up to 5 %. All count alike.
double sight_loss(const PictureTruth& picture);

struct CoherenceMetrics {
  ShotDeviation mean;       // over the frames, each at most 1
  double kept_share = 0.0;  // of the frames in which no property deviates by more than half, [0, 1]
  // Over the judged pictures. Worth: picture_worth with the default weights. As asked: the share of the pictures in
  // which every target is shown whole and no property is outside its free band.
  double mean_worth = 0.0, mean_sight_loss = 0.0, mean_shot_loss = 0.0, as_asked_share = 0.0;
  // Elevations of the camera over the targets' centre, or over the middle of the shot's subjects: the one that was
  // asked for at the first frame, the median over the frames, and the share of them above kHighRad.
  double asked_height_rad = 0.0, median_height_rad = 0.0, high_share = 0.0;
  // The sum of the changes of the camera's velocity between neighbouring frames, over the time of the run. Frames at a
  // declared jump of the camera are left out.
  double mean_acceleration_mps2 = 0.0;
};
// `shots` are as long as `frames`, `truths` as well, or empty. `tolerance` as in deviation_between. All 0 without
// frames.
CoherenceMetrics coherence_of(std::span<const CameraFrame> frames, std::span<const FrameShot> shots,
                              std::span<const FrameTruth> truths, double tolerance = 1.0);

}  // namespace sightline
