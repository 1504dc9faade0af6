#include "client/truth/coherence.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "client/truth/metrics.h"
#include "client/truth/motion.h"

namespace sightline {

ShotProperties shot_properties(const CameraFrame& frame, const glm::dvec3& center_m) {
  const glm::dvec3 in_view_m = inverse_transform_point(frame.camera, center_m);
  ShotProperties shot = shot_from(frame.camera.position_m - center_m, frame.lens.vertical_fov_rad);
  const double depth_m = -in_view_m.z;
  shot.place_half_pictures = depth_m > 0 ? glm::dvec2(in_view_m.x / frame.lens.aspect, in_view_m.y) /
                                               (depth_m * std::tan(frame.lens.vertical_fov_rad / 2))
                                         : glm::dvec2(std::numeric_limits<double>::infinity());
  return shot;
}

double largest_of(const ShotDeviation& deviation) {
  return std::max({deviation.side, deviation.height, deviation.size, deviation.place});
}

double mean_of(const ShotDeviation& deviation) {
  return (deviation.side + deviation.height + deviation.size + deviation.place) / 4;
}

double sight_loss(const PictureTruth& picture) {
  double loss = 0;
  for (const TargetTruth& target : picture.targets)
    loss += std::max(0.0, kLeastOfWhole - target.whole_share()) / kLeastOfWhole;
  return picture.targets.empty() ? 0.0 : loss / static_cast<double>(picture.targets.size());
}

std::vector<FrameShot> shots_as_begun(std::span<const CameraFrame> frames, std::span<const glm::dvec3> centers_m) {
  std::vector<FrameShot> shots;
  for (size_t i = 0; i < frames.size(); ++i) {
    const ShotProperties now = shot_properties(frames[i], centers_m[i]);
    shots.push_back({i == 0 ? now : shots[0].asked, now});
  }
  return shots;
}

CoherenceMetrics coherence_of(std::span<const CameraFrame> frames, std::span<const FrameShot> shots,
                              std::span<const FrameTruth> truths, double tolerance) {
  CoherenceMetrics metrics;
  if (frames.empty()) return metrics;
  const ShotWeights weights;
  size_t pictures = 0;
  std::vector<double> heights_rad;
  for (size_t i = 0; i < frames.size(); ++i) {
    const ShotProperties& shot = shots[i].now;
    const ShotDeviation now = up_to_limits(deviation_between(shots[i].asked, shot, tolerance));
    if (i < truths.size() && truths[i].picture) {
      const PictureTruth& picture = *truths[i].picture;
      const double lacks = sight_loss(picture), departs = shot_loss(now, weights);
      ++pictures;
      metrics.mean_worth += picture_worth(lacks, departs), metrics.mean_sight_loss += lacks,
          metrics.mean_shot_loss += departs;
      metrics.as_asked_share += picture.all_whole() && largest_of(now) == 0;
    }
    heights_rad.push_back(shot.height_rad);
    metrics.high_share += shot.height_rad > kHighRad;
    metrics.mean.side += now.side, metrics.mean.height += now.height, metrics.mean.size += now.size,
        metrics.mean.place += now.place;
    metrics.kept_share += largest_of(now) <= kKeptDeviation;
  }
  const auto count = static_cast<double>(frames.size());
  for (double* const sum : {&metrics.mean.side, &metrics.mean.height, &metrics.mean.size, &metrics.mean.place,
                            &metrics.kept_share, &metrics.high_share})
    *sum /= count;
  for (double* const sum :
       {&metrics.mean_worth, &metrics.mean_sight_loss, &metrics.mean_shot_loss, &metrics.as_asked_share})
    *sum /= static_cast<double>(std::max<size_t>(pictures, 1));
  metrics.asked_height_rad = shots[0].asked.height_rad;
  metrics.median_height_rad = percentile(std::move(heights_rad), 0.5);
  double changes_mps = 0, time_s = 0;
  const std::vector<MotionSample> motion = motion_of(frames);
  for (size_t i = 1; i < frames.size(); ++i) {
    if (!motion[i].valid) continue;
    const double tick_s = frames[i].time_s - frames[i - 1].time_s;
    changes_mps += motion[i].acceleration_mps2 * tick_s, time_s += tick_s;
  }
  if (time_s > 0) metrics.mean_acceleration_mps2 = changes_mps / time_s;
  return metrics;
}

}  // namespace sightline
