#include "server/move/framing.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "server/base/check.h"

namespace sightline {
namespace {

constexpr int kAimIterations = 4;

// The extent of the group along one axis of the picture, in radians from the middle: the interval that must fit, and
// the weighted mean.
struct Extent {
  double low = 1e9, high = -1e9, mean = 0;
  void include(double middle, double half) { low = std::min(low, middle - half), high = std::max(high, middle + half); }
  // The turn that fits [low, high] into [-half, half] and brings the mean as near to the middle as possible.
  double shift(double half) const {
    const double least = high - half, most = low + half;
    return least <= most ? std::clamp(mean, least, most) : (low + high) / 2;
  }
  // The least turn that does.
  double least_shift(double half) const { return Extent{low, high, 0.0}.shift(half); }
  double reach() const { return std::max(std::abs(low), std::abs(high)); }
};
struct Extents {
  Extent x, y;
};

bool must_fit(const TrackedTarget& target, bool any_required) {
  return target.steered() && (target.required || !any_required);
}

bool any_required_of(std::span<const TrackedTarget> targets) {
  return std::any_of(targets.begin(), targets.end(), [](const auto& t) { return t.steered() && t.required; });
}

double angle_of_radius(double radius_m, double distance_m) {
  return std::asin(std::min(1.0, radius_m / std::max(distance_m, 1e-9)));
}

void include_sphere(const glm::dvec3& middle_m, double radius_m, Extents& out) {
  out.x.include(std::atan2(middle_m.x, -middle_m.z), angle_of_radius(radius_m, std::hypot(middle_m.x, middle_m.z)));
  out.y.include(std::atan2(middle_m.y, -middle_m.z), angle_of_radius(radius_m, std::hypot(middle_m.y, middle_m.z)));
}

// A body about its vertical axis. Its highest and lowest points in the picture are on the rims of its ends, towards the
// camera and away from it. In a picture that leans, they may also be at the sides of the rims.
void include_body(const TrackedTarget& target, const glm::dvec3& middle_m, const glm::dquat& camera_from_world,
                  bool leans, Extents& out) {
  const glm::dvec3 up = camera_from_world * glm::dvec3(0, 1, 0), level = up * up.z - glm::dvec3(0, 0, 1);
  const glm::dvec3 away = level / std::max(glm::length(level), 1e-9);
  for (const double along_m : {-target.low_m, target.high_m}) {
    const glm::dvec3 end_m = middle_m + along_m * up;
    out.x.include(std::atan2(end_m.x, -end_m.z), angle_of_radius(target.aside_m, std::hypot(end_m.x, end_m.z)));
    for (const double out_m : {-target.aside_m, target.aside_m}) {
      const glm::dvec3 rim_m = end_m + out_m * away;
      out.y.include(std::atan2(rim_m.y, -rim_m.z), 0.0);
      const glm::dvec3 side_m = end_m + out_m * glm::cross(up, away);
      if (leans) out.y.include(std::atan2(side_m.y, -side_m.z), 0.0);
    }
  }
}

// The targets that count for the aim: those with a place in the picture, or all if none has one.
bool any_place_of(std::span<const TrackedTarget> targets) {
  return std::any_of(targets.begin(), targets.end(), [](const auto& t) { return t.steered() && t.place; });
}

// The direction of a place in the picture, radians from the middle.
glm::dvec2 place_angles(const TrackedTarget& target, const Lens& lens) {
  if (!target.place) return glm::dvec2(0.0);
  const double top = std::tan(lens.vertical_fov_rad / 2);
  return {std::atan(target.place->x * top * lens.aspect), std::atan(target.place->y * top)};
}

Extents extents_at(const glm::dvec3& eye_m, std::span<const TrackedTarget> targets, const ViewAngles& angles,
                   const Lens& lens) {
  const glm::dquat camera_from_world = glm::conjugate(rotation_from_angles(angles));
  const bool any_required = any_required_of(targets), any_place = any_place_of(targets);
  Extents out;
  double weight = 0;
  for (const TrackedTarget& target : targets) {
    if (!target.steered()) continue;
    const glm::dvec3 p = camera_from_world * (target.aim_m - eye_m);
    const double ax = std::atan2(p.x, -p.z), ay = std::atan2(p.y, -p.z);
    if (must_fit(target, any_required)) {
      if (target.has_body())
        include_body(target, p, camera_from_world, angles.roll_rad != 0, out);
      else
        include_sphere(p, target.radius_m, out);
    }
    if (any_place && !target.place) continue;
    const glm::dvec2 wanted = place_angles(target, lens);
    out.x.mean += target.weight * (ax - wanted.x);
    out.y.mean += target.weight * (ay - wanted.y);
    weight += target.weight;
  }
  out.x.mean /= weight;
  out.y.mean /= weight;
  return out;
}

ViewAngles angles_towards(const glm::dvec3& direction, const ViewAngles& present) {
  const double flat = std::hypot(direction.x, direction.z);
  if (flat < 1e-9 && std::abs(direction.y) < 1e-9) return {present.yaw_rad, present.pitch_rad, 0};
  const double yaw = flat < 1e-6 ? present.yaw_rad : std::atan2(-direction.x, -direction.z);
  return {yaw, std::clamp(std::atan2(direction.y, flat), -kMaxPitchRad, kMaxPitchRad), 0};
}

double zoom_for(const Extents& extents, const Lens& lens, const FramingSettings& settings) {
  if (!zooms(settings)) return lens.vertical_fov_rad;
  const auto tan_within = [&](double reach) { return std::tan(std::min(reach / (1 - settings.framing_margin), 1.5)); };
  const double half = std::atan(std::max(tan_within(extents.y.reach()), tan_within(extents.x.reach()) / lens.aspect));
  return std::clamp(2 * half, settings.min_vertical_fov_rad, settings.max_vertical_fov_rad);
}

// The part of a shift that exceeds the dead zone.
double beyond(double shift, double dead) {
  return shift - std::clamp(shift, -dead, dead);
}

// Turns by these angles along the axes of the picture, which may lean.
void turn_along(const glm::dvec2& shift_rad, bool keeps_yaw, ViewAngles& angles) {
  const double cosine = std::cos(angles.roll_rad), sine = std::sin(angles.roll_rad);
  if (!keeps_yaw) angles.yaw_rad -= shift_rad.x * cosine - shift_rad.y * sine;
  angles.pitch_rad = std::clamp(angles.pitch_rad + shift_rad.x * sine + shift_rad.y * cosine, -kMaxPitchRad,
                                kMaxPitchRad);
}

// From `present` to `wanted`, but for the dead zone.
ViewAngles outside_dead_zone(const ViewAngles& present, const ViewAngles& wanted, const glm::dvec2& dead_rad) {
  return {present.yaw_rad + beyond(std::remainder(wanted.yaw_rad - present.yaw_rad, 2 * std::numbers::pi), dead_rad.x),
          present.pitch_rad + beyond(wanted.pitch_rad - present.pitch_rad, dead_rad.y), wanted.roll_rad};
}

}  // namespace

Aim aim_at(const glm::dvec3& eye_m, std::span<const TrackedTarget> targets, const ViewAngles& present, const Lens& lens,
           const AimRules& rules) {
  const glm::dvec2 half_rad(half_horizontal_fov_rad(lens), lens.vertical_fov_rad / 2);
  const double room = 1 - rules.framing.framing_margin;
  const bool keeps_yaw = rules.fixed_yaw_rad.has_value();
  ViewAngles angles = angles_towards(weighted_center_m(targets) - eye_m, present);
  if (keeps_yaw) angles.yaw_rad = *rules.fixed_yaw_rad;
  angles.roll_rad = rules.roll_rad;
  for (int i = 0; i < kAimIterations; ++i) {
    const Extents at = extents_at(eye_m, targets, angles, lens);
    turn_along({at.x.shift(half_rad.x * room), at.y.shift(half_rad.y * room)}, keeps_yaw, angles);
  }
  const Extents at = extents_at(eye_m, targets, angles, lens);
  Aim aim;
  aim.vertical_fov_rad = zoom_for(at, lens, rules.framing);
  aim.fits = at.x.reach() <= half_rad.x && at.y.reach() <= half_rad.y;
  aim.off_half_pictures = glm::abs(glm::dvec2(std::remainder(angles.yaw_rad - present.yaw_rad, 2 * std::numbers::pi),
                                              angles.pitch_rad - present.pitch_rad)) /
                          half_rad;
  aim.angles = outside_dead_zone(present, angles,
                                 rules.dead_zone.value_or(glm::dvec2(rules.framing.dead_zone)) * half_rad);
  if (aim.fits && rules.dead_zone) {
    const Extents dead = extents_at(eye_m, targets, aim.angles, lens);
    turn_along({dead.x.least_shift(half_rad.x), dead.y.least_shift(half_rad.y)}, keeps_yaw, aim.angles);
  }
  return aim;
}

glm::dvec2 off_place_half_pictures(const Pose& world_from_camera, std::span<const TrackedTarget> targets,
                                   const Lens& lens) {
  const bool any_place = any_place_of(targets);
  const double top = std::tan(lens.vertical_fov_rad / 2);
  glm::dvec2 sum(0.0);
  double weight = 0;
  for (const TrackedTarget& target : targets) {
    if (!target.steered() || (any_place && !target.place)) continue;
    const glm::dvec3 p = inverse_transform_point(world_from_camera, target.aim_m);
    if (p.z >= 0) return glm::dvec2(std::numeric_limits<double>::infinity());
    sum += target.weight * (glm::dvec2(p.x / lens.aspect, p.y) / (-p.z * top) - target.place.value_or(glm::dvec2(0.0)));
    weight += target.weight;
  }
  return weight > 0 ? sum / weight : sum;
}

bool fits_picture(const glm::dvec3& eye_m, std::span<const TrackedTarget> targets, const ViewAngles& present,
                  const Lens& lens, double room, bool required_only) {
  const bool any_required = required_only && any_required_of(targets);
  ViewAngles angles = angles_towards(weighted_center_m(targets) - eye_m, present);
  Extents at;
  for (int i = 0; i <= kAimIterations; ++i) {
    const glm::dquat camera_from_world = glm::conjugate(rotation_from_angles({angles.yaw_rad, angles.pitch_rad, 0}));
    at = {};
    for (const TrackedTarget& target : targets) {
      if (!must_fit(target, any_required)) continue;
      const glm::dvec3 p = camera_from_world * (target.aim_m - eye_m);
      at.x.include(std::atan2(p.x, -p.z), 0.0);
      at.y.include(std::atan2(p.y, -p.z), 0.0);
    }
    if (i == kAimIterations) break;
    angles.yaw_rad -= (at.x.low + at.x.high) / 2;
    angles.pitch_rad = std::clamp(angles.pitch_rad + (at.y.low + at.y.high) / 2, -kMaxPitchRad, kMaxPitchRad);
  }
  return at.x.reach() <= room * half_horizontal_fov_rad(lens) && at.y.reach() <= room * lens.vertical_fov_rad / 2;
}

bool in_picture(const Pose& world_from_camera, const Lens& lens, const glm::dvec3& point_m) {
  const glm::dvec3 p = inverse_transform_point(world_from_camera, point_m);
  const double top = std::tan(lens.vertical_fov_rad / 2);
  return p.z < 0 && std::abs(p.y) <= -p.z * top && std::abs(p.x) <= -p.z * top * lens.aspect;
}

}  // namespace sightline
