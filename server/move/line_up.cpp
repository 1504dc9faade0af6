#include "server/move/line_up.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "server/move/choose.h"
#include "server/move/framing.h"

namespace sightline {
namespace {

// The elevation of a shot in line: the far target is seen over the near one.
constexpr double kInLineRad = 0.05;
// Targets that fill more of the picture than this let the shot turn.
constexpr double kRoom = 0.7;
// No target is shown from farther than this many times max_distance_m, since it would be too small. Two targets of
// equal weight are never farther from the ends of their line.
constexpr double kFarthestShare = 2.0;
// The limits of distance are narrower by this part of the room that is to be left free.
constexpr double kDistanceRoom = 0.2;
// Each halves the error of the turn.
constexpr int kTurnSteps = 12;

// The direction in which the steered targets are spread most, horizontally; zero if they are at one place. It is the
// principal axis of their places, by weight.
glm::dvec2 line_of(const FarShot& shot) {
  const glm::dvec3 center_m = weighted_center_m(shot.targets);
  double xx = 0, xz = 0, zz = 0;
  for (const TrackedTarget& t : shot.targets) {
    if (!t.steered()) continue;
    const double x = t.aim_m.x - center_m.x, z = t.aim_m.z - center_m.z;
    xx += t.weight * x * x, xz += t.weight * x * z, zz += t.weight * z * z;
  }
  if (xx + zz < 1e-6) return glm::dvec2(0.0);
  const double angle_rad = std::atan2(2 * xz, xx - zz) / 2;
  return {std::cos(angle_rad), std::sin(angle_rad)};
}

// The reasons for an end of the line, the most important one first (see line_up).
std::array<double, 4> rank_of_end(const FarShot& shot, const glm::dvec2& to_end) {
  const glm::dvec3 center_m = weighted_center_m(shot.targets);
  const auto along = [&](const glm::dvec3& offset_m) { return glm::dot(to_end, glm::dvec2(offset_m.x, offset_m.z)); };
  std::array<double, 4> rank{along(shot.former_end_m), 0, 0, along(shot.camera_m - center_m)};
  for (const TrackedTarget& t : shot.targets) {
    if (!t.steered() || along(t.aim_m - center_m) <= 0) continue;
    if (t.required) rank[1] += t.weight;
    rank[2] += t.weight;
  }
  return rank;
}

// The directions from that of the shot (part 0) to an end of the line (part 1).
class Turn {
 public:
  Turn(const FarShot& shot, const glm::dvec2& to_end)
      : shot_(shot),
        azimuth_rad_(std::atan2(shot.offset_m.z, shot.offset_m.x)),
        elevation_rad_(allowed(elevation_rad(shot.offset_m))) {
    turn_rad_ = std::remainder(std::atan2(to_end.y, to_end.x) - azimuth_rad_, 2 * std::numbers::pi);
    rise_rad_ = allowed(kInLineRad) - elevation_rad_;
  }
  glm::dvec3 direction(double part) const {
    const double azimuth_rad = azimuth_rad_ + part * turn_rad_, elevation_rad = elevation_rad_ + part * rise_rad_;
    const double flat = std::cos(elevation_rad);
    return {std::cos(azimuth_rad) * flat, std::sin(elevation_rad), std::sin(azimuth_rad) * flat};
  }
  bool fits(double part, double room) const {
    const glm::dvec3 place_m = farthest_place_m(shot_.targets, direction(part), shot_.settings);
    const MoveSettings& limits = shot_.settings;
    const double narrowed = 1 - kDistanceRoom * (1 - room);
    const bool keeps_distance = std::ranges::all_of(shot_.targets, [&](const TrackedTarget& t) {
      const double distance_m = glm::distance(place_m, t.aim_m);
      return !t.steered() || (distance_m >= limits.min_distance_m / narrowed &&
                              distance_m <= kFarthestShare * limits.max_distance_m * narrowed);
    });
    return keeps_distance && fits_picture(place_m, shot_.targets, {}, shot_.lens, room, false);
  }
  // The least part of the turn that fits. The whole turn does.
  double least_part(double room) const {
    double low = 0, high = 1;
    for (int k = 0; k < kTurnSteps; ++k) {
      const double middle = (low + high) / 2;
      (fits(middle, room) ? high : low) = middle;
    }
    return high;
  }

 private:
  double allowed(double elevation_rad) const {
    return std::clamp(elevation_rad, shot_.settings.min_elevation_rad, shot_.settings.max_elevation_rad);
  }

  const FarShot& shot_;
  double azimuth_rad_, elevation_rad_, turn_rad_ = 0, rise_rad_ = 0;
};

// To the better end of those from which the targets fit and are seen.
std::optional<Turn> turn_into_line(const FarShot& shot, double room, const SeenFrom& is_seen_from) {
  glm::dvec2 to_end = line_of(shot);
  if (to_end == glm::dvec2(0.0)) return std::nullopt;
  if (rank_of_end(shot, -to_end) > rank_of_end(shot, to_end)) to_end = -to_end;
  for (const double side : {1.0, -1.0})
    if (const Turn turn(shot, side * to_end);
        turn.fits(1, room) && is_seen_from(turn.direction(1) * shot.settings.max_distance_m))
      return turn;
  return std::nullopt;
}

}  // namespace

bool fits_from_side(const FarShot& shot, double room) {
  return fits_picture(farthest_place_m(shot.targets, shot.offset_m, shot.settings), shot.targets, {}, shot.lens, room,
                      false);
}

bool fits_in_line(const FarShot& shot, double room) {
  return turn_into_line(shot, room, [](const glm::dvec3&) { return true; }).has_value();
}

std::optional<LinedUp> line_up(const FarShot& shot, const SeenFrom& is_seen_from) {
  if (fits_from_side(shot, kRoom)) return std::nullopt;
  const auto turned = [&](const Turn& turn, double part) {
    return LinedUp{turn.direction(part) * glm::length(shot.offset_m), turn.direction(1) * shot.settings.max_distance_m};
  };
  if (const auto turn = turn_into_line(shot, kRoom, is_seen_from)) return turned(*turn, turn->least_part(kRoom));
  if (const auto turn = turn_into_line(shot, 1.0, is_seen_from)) return turned(*turn, 1);
  return std::nullopt;
}

}  // namespace sightline
