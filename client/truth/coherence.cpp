#include "client/truth/coherence.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "client/truth/metrics.h"
#include "client/truth/motion.h"

namespace sightline {
namespace {

double deviation(double difference, const FreeBand& band) {
  const double beyond = std::abs(difference) - band.free;
  return std::clamp(beyond / (band.limit - band.free), 0.0, 1.0);
}

double angle_between(double a_rad, double b_rad) {
  return std::remainder(a_rad - b_rad, 2 * std::numbers::pi);
}

}  // namespace

ShotProperties shot_properties(const CameraFrame& frame, const glm::dvec3& center_m) {
  const glm::dvec3 offset_m = frame.camera.position_m - center_m;
  const glm::dvec3 in_view_m = inverse_transform_point(frame.camera, center_m);
  const double tan_half = std::tan(frame.lens.vertical_fov_rad / 2);
  ShotProperties shot;
  shot.side_rad = std::atan2(offset_m.x, offset_m.z);
  shot.height_rad = std::atan2(offset_m.y, std::hypot(offset_m.x, offset_m.z));
  shot.size_log2 = -std::log2(2 * std::max(glm::length(offset_m), 1e-9) * tan_half);
  const double depth_m = -in_view_m.z;
  shot.place_half_pictures = depth_m > 0 ? glm::dvec2(in_view_m.x / frame.lens.aspect, in_view_m.y) / (depth_m * tan_half)
                                         : glm::dvec2(std::numeric_limits<double>::infinity());
  return shot;
}

ShotDeviation deviation_between(const ShotProperties& asked, const ShotProperties& now) {
  const glm::dvec2 shift = now.place_half_pictures - asked.place_half_pictures;
  const double farther = std::max(std::abs(shift.x), std::abs(shift.y));
  return {.side = deviation(angle_between(now.side_rad, asked.side_rad), kSideBandRad),
          .height = deviation(now.height_rad - asked.height_rad, kHeightBandRad),
          .size = deviation(now.size_log2 - asked.size_log2, kSizeBandLog2),
          .place = std::isfinite(farther) ? deviation(farther, kPlaceBandHalfPictures) : 1.0};
}

CoherenceMetrics coherence_of(std::span<const CameraFrame> frames, std::span<const glm::dvec3> centers_m) {
  CoherenceMetrics metrics;
  if (frames.empty()) return metrics;
  const ShotProperties asked = shot_properties(frames[0], centers_m[0]);
  std::vector<double> heights_rad;
  for (size_t i = 0; i < frames.size(); ++i) {
    const ShotProperties shot = shot_properties(frames[i], centers_m[i]);
    const ShotDeviation now = deviation_between(asked, shot);
    heights_rad.push_back(shot.height_rad);
    metrics.high_share += shot.height_rad > kHighRad;
    metrics.mean.side += now.side, metrics.mean.height += now.height, metrics.mean.size += now.size, metrics.mean.place += now.place;
    metrics.kept_share += std::max({now.side, now.height, now.size, now.place}) <= 0.5;
  }
  const auto count = static_cast<double>(frames.size());
  for (double* const sum : {&metrics.mean.side, &metrics.mean.height, &metrics.mean.size, &metrics.mean.place, &metrics.kept_share, &metrics.high_share}) *sum /= count;
  metrics.asked_height_rad = asked.height_rad;
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
