#include "server/move/choose.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "server/base/check.h"

namespace sightline {
namespace {

constexpr double kHalfPi = std::numbers::pi / 2;

// The distance from the centre, along unit `outwards`, at which the whole group fits the picture.
double fitting_distance_m(std::span<const TrackedTarget> targets, const glm::dvec3& center_m,
                          const glm::dvec3& outwards, const Lens& lens, double margin) {
  const glm::dquat camera = look_rotation(-outwards, {0, 1, 0}, {1, 0, 0});
  const double half_y = lens.vertical_fov_rad / 2 * (1 - margin), half_x = half_horizontal_fov_rad(lens) * (1 - margin);
  double distance = 0;
  for (const TrackedTarget& t : targets) {
    if (!t.steered()) continue;
    const glm::dvec3 p = glm::conjugate(camera) * (t.aim_m - center_m);
    // A sphere touches the side of the frustum when its centre is r / sin(half angle) behind the frustum's corner.
    distance = std::max({distance, p.z + std::abs(p.x) / std::tan(half_x) + t.radius_m / std::sin(half_x),
                         p.z + std::abs(p.y) / std::tan(half_y) + t.radius_m / std::sin(half_y)});
  }
  return distance;
}

glm::dvec3 with_elevation(const glm::dvec3& offset, double elevation) {
  const double length = glm::length(offset), flat = std::hypot(offset.x, offset.z);
  const glm::dvec2 heading = flat > 1e-9 ? glm::dvec2(offset.x, offset.z) / flat : glm::dvec2(0, 1);
  const glm::dvec2 level = heading * (length * std::cos(elevation));
  return {level.x, length * std::sin(elevation), level.y};
}

}  // namespace

uint32_t steered_mask(std::span<const TrackedTarget> targets) {
  uint32_t mask = 0;
  for (size_t i = 0; i < targets.size(); ++i)
    if (targets[i].steered()) mask |= 1u << i;
  return mask;
}

double elevation_rad(const glm::dvec3& offset_m) {
  return std::atan2(offset_m.y, std::hypot(offset_m.x, offset_m.z));
}

glm::dvec3 weighted_center_m(std::span<const TrackedTarget> targets) {
  glm::dvec3 sum(0.0);
  double weight = 0;
  for (const TrackedTarget& t : targets)
    if (t.steered()) sum += t.weight * t.aim_m, weight += t.weight;
  return sum / weight;
}

glm::dvec3 desired_place_m(std::span<const TrackedTarget> targets, const glm::dvec3& offset_m, const Lens& lens,
                           double framing_margin, const MoveSettings& settings) {
  const glm::dvec3 center = weighted_center_m(targets);
  glm::dvec3 offset = glm::length(offset_m) > 1e-6 ? offset_m : glm::dvec3(0, 0, 1e-3);
  if (settings.follow == Follow::kStay) return center + offset_m;
  const double elevation = std::clamp(elevation_rad(offset), settings.min_elevation_rad, settings.max_elevation_rad);
  offset = with_elevation(offset, elevation);
  const glm::dvec3 outwards = glm::normalize(offset);
  double nearest_allowed = fitting_distance_m(targets, center, outwards, lens, framing_margin);
  for (const TrackedTarget& t : targets)
    if (t.steered())
      nearest_allowed = std::max(nearest_allowed, glm::dot(t.aim_m - center, outwards) + settings.min_distance_m);
  const double distance = std::min(std::max(glm::length(offset), nearest_allowed), settings.max_distance_m);
  return center + outwards * distance;
}

glm::dvec3 farthest_place_m(std::span<const TrackedTarget> targets, const glm::dvec3& offset_m,
                            const MoveSettings& settings) {
  const glm::dvec3 offset = glm::length(offset_m) > 1e-6 ? offset_m : glm::dvec3(0, 0, 1e-3);
  const double elevation = std::clamp(elevation_rad(offset), settings.min_elevation_rad, settings.max_elevation_rad);
  return weighted_center_m(targets) + glm::normalize(with_elevation(offset, elevation)) * settings.max_distance_m;
}

PlaceLimits::PlaceLimits(std::span<const TrackedTarget> targets, const MoveSettings& settings)
    : targets_(targets),
      settings_(settings),
      center_m_(weighted_center_m(targets)),
      low_(std::cos(settings.min_elevation_rad), std::sin(settings.min_elevation_rad)),
      high_(std::cos(settings.max_elevation_rad), std::sin(settings.max_elevation_rad)) {}

// An elevation e is above a limit l when sin(e - l) > 0, which is (y cos l - flat sin l) / distance. So the arc tangent
// is only needed where that is within rounding of 0.
bool PlaceLimits::hold(const glm::dvec3& place_m) const {
  for (const TrackedTarget& t : targets_)
    if (t.steered() && glm::distance(place_m, t.aim_m) < settings_.min_distance_m) return false;
  const glm::dvec3 from_center = place_m - center_m_;
  const double distance_m = glm::length(from_center);
  if (!(distance_m <= settings_.max_distance_m)) return false;
  const double flat_m = std::sqrt(from_center.x * from_center.x + from_center.z * from_center.z);
  const double over_low = from_center.y * low_.x - flat_m * low_.y,
               over_high = from_center.y * high_.x - flat_m * high_.y;
  const double rounding_m = 1e-12 * distance_m;
  if (over_low < -rounding_m || over_high > rounding_m) return false;
  if (over_low > rounding_m && over_high < -rounding_m) return true;
  return within_limits(place_m, targets_, settings_);
}

bool within_limits(const glm::dvec3& place_m, std::span<const TrackedTarget> targets, const MoveSettings& settings) {
  for (const TrackedTarget& t : targets)
    if (t.steered() && glm::distance(place_m, t.aim_m) < settings.min_distance_m) return false;
  const glm::dvec3 from_center = place_m - weighted_center_m(targets);
  const double elevation = elevation_rad(from_center);
  return glm::length(from_center) <= settings.max_distance_m && elevation >= settings.min_elevation_rad &&
         elevation <= settings.max_elevation_rad;
}

BrokenLimits broken_limits(const glm::dvec3& place_m, std::span<const TrackedTarget> targets,
                           const MoveSettings& settings) {
  constexpr double kToleratedM = 1e-3, kToleratedRad = 1e-3;
  if (steered_mask(targets) == 0) return {};
  const glm::dvec3 from_center = place_m - weighted_center_m(targets);
  const double elevation = elevation_rad(from_center);
  BrokenLimits broken{.distance = glm::length(from_center) > settings.max_distance_m + kToleratedM,
                      .elevation = elevation < settings.min_elevation_rad - kToleratedRad ||
                                   elevation > settings.max_elevation_rad + kToleratedRad};
  for (const TrackedTarget& t : targets)
    broken.distance |= t.steered() && glm::distance(place_m, t.aim_m) < settings.min_distance_m - kToleratedM;
  return broken;
}

Choice choice_of(uint32_t candidate, const CandidateSet& candidates, std::span<const TrackedTarget> targets) {
  const uint32_t steered = steered_mask(targets);
  if (steered == 0) return {MoveStatus::kHolding, MoveReason::kNoTargets, -1};
  const uint32_t seen = candidates.filtered()[candidate] & steered;
  const MoveStatus status = seen == 0         ? MoveStatus::kEscaping
                            : seen == steered ? MoveStatus::kTracking
                                              : MoveStatus::kPartial;
  return {status, MoveReason::kBestSoon, static_cast<int>(candidate)};
}

}  // namespace sightline
