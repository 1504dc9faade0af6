#include "server/move/body.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "server/move/motion.h"

namespace sightline {
namespace {

// Sweeps start this much inside the measured clearance, so that a camera that touches its skin can still slide.
constexpr double kSweepSlackM = 0.002;

// A camera that is closer than its skin comes nearer by no more than this in a step, and always stays farther away than
// a sweep's error.
constexpr double kNearerM = 1e-6, kNeverPressedM = 2e-9;

// Distance kept from moving colliders beyond the body radius, since their velocity may change.
constexpr double kEvadeRoomM = 0.1;

// The radius to sweep from a position with this clearance: the body with its whole skin, or less where the camera is
// already closer.
double sweep_radius_m(double clearance_m, double body_m) {
  return std::clamp(clearance_m - kSweepSlackM, body_m, body_m + kBodySkinM);
}
// Clearances are measured up to this distance.
double clearance_reach_m(double body_m) {
  return body_m + 2 * kBodySkinM;
}

class SafetyCheck {
 public:
  SafetyCheck(const CameraState& camera, const CameraLimits& limits, const Lens& lens, const ClearanceField& field,
              double dt_s)
      : camera_(camera),
        limits_(limits),
        field_(field),
        dt_s_(dt_s),
        body_m_(swept_radius_m(limits, lens)),
        clearance_m_(clearance_reach_m(body_m_)) {
    glm::dvec3 surface;
    if (field.nearest(camera.pose.position_m, clearance_m_, surface)) {
      away_m_ = camera.pose.position_m - surface;
      clearance_m_ = glm::length(away_m_);
    }
    sweep_m_ = has_skin() ? sweep_radius_m(clearance_m_, body_m_)
                          : std::max(clearance_m_ - kNearerM, body_m_ + kNeverPressedM);
  }

  bool overlaps() const { return clearance_m_ < body_m_; }
  // Returns whether any of the skin is left.
  bool has_skin() const { return clearance_m_ >= body_m_ + kSweepSlackM; }

  // Returns whether the path is free for the step and for braking after it.
  bool is_safe(const glm::dvec3& velocity) {
    const double speed = glm::length(velocity);
    if (speed < 1e-9) return true;
    const double reach = speed * dt_s_ + braking_distance_m(velocity, limits_);
    const glm::dvec3 from = camera_.pose.position_m;
    return field_.is_free(from, from + velocity * (reach / speed), sweep_m_, blocker_);
  }

  // The velocity without its component into the surface in the way.
  glm::dvec3 along_surface(const glm::dvec3& velocity) const {
    const glm::dvec3 from = camera_.pose.position_m;
    const double speed = glm::length(velocity);
    const double reach = speed * dt_s_ + braking_distance_m(velocity, limits_);
    const glm::dvec3 to = from + velocity * (reach / std::max(speed, 1e-9));
    const glm::dvec3 stop = from + (to - from) * field_.free_fraction(from, to, sweep_m_);
    glm::dvec3 surface;
    if (!field_.nearest(stop, sweep_m_ + 0.1, surface) || surface == stop) return velocity;
    const glm::dvec3 out = glm::normalize(stop - surface);
    return velocity - out * std::min(0.0, glm::dot(velocity, out));
  }

  // The velocity away from the nearest surface, as fast as the camera can still stop within the skin.
  glm::dvec3 velocity_out() const {
    if (clearance_m_ < 1e-9) return glm::dvec3(0, 1, 0);
    const double missing = body_m_ + kBodySkinM - clearance_m_;
    return away_m_ / clearance_m_ * std::sqrt(2 * limits_.max_acceleration_mps2 * std::max(missing, 0.0));
  }

  // Returns whether a body that moves straight away from the nearest surface meets an opposite one.
  bool is_wedged() const {
    if (clearance_m_ < 1e-9) return true;
    const glm::dvec3 out = camera_.pose.position_m + away_m_ * ((body_m_ + kBodySkinM - clearance_m_) / clearance_m_);
    return field_.clearance_m(out, body_m_) < body_m_;
  }

  // The least clearance after the step and at the end of braking after it.
  double room_m(const glm::dvec3& velocity) const {
    const glm::dvec3 next = camera_.pose.position_m + velocity * dt_s_;
    const double speed = glm::length(velocity), reach_m = clearance_reach_m(body_m_);
    const glm::dvec3 stop = speed > 1e-9 ? next + velocity * (braking_distance_m(velocity, limits_) / speed) : next;
    return std::min(field_.clearance_m(next, reach_m), field_.clearance_m(stop, reach_m));
  }

  glm::dvec3 limited(const glm::dvec3& wanted) const {
    return clamp_velocity(camera_.velocity_mps, wanted, limits_, dt_s_);
  }

 private:
  const CameraState& camera_;
  const CameraLimits& limits_;
  const ClearanceField& field_;
  const double dt_s_, body_m_;
  double clearance_m_, sweep_m_;
  glm::dvec3 away_m_{0.0};  // from the nearest surface, within the reach
  size_t blocker_ = ClearanceField::kNoBlocker;
};

// The velocity that leaves the most room: out of the collider that the body touches, or midway between opposite
// surfaces.
glm::dvec3 roomiest(const SafetyCheck& check) {
  const glm::dvec3 out = check.velocity_out();
  glm::dvec3 best(0.0);
  double most_m = -1;
  for (const double share : {1.0, 0.5, 0.25, 0.1, 0.0}) {
    const glm::dvec3 velocity = check.limited(share * out);
    const double room_m = check.room_m(velocity);
    if (room_m > most_m) most_m = room_m, best = velocity;
  }
  return best;
}

// Finds the nearest place where a ball of radius `room_m` is free and outside of every solid.
class WayOut {
 public:
  WayOut(const ClearanceField& field, const glm::dvec3& from_m, double room_m)
      : field_(field),
        from_m_(from_m),
        room_m_(room_m),
        inside_(field.is_inside(from_m)),
        first_step_m_(step_m(from_m, inside_)),
        least_m_(std::min(kFarthestOutM, field.reach_m() - 2 * room_m)) {}

  std::optional<glm::dvec3> find() {
    if (first_step_m_ < kTightM) return from_m_;
    glm::dvec3 surface_m;
    if (field_.nearest(from_m_, field_.reach_m(), surface_m) && surface_m != from_m_)
      try_way(glm::normalize(inside_ ? surface_m - from_m_ : from_m_ - surface_m));
    for (int i = 0; i < kDirections; ++i) try_way(spread_direction(i));
    for (const double aside : {0.3, 0.15, 0.07, 0.03}) try_beside(aside);
    return found_m_;
  }

 private:
  static constexpr double kFarthestOutM = 10.0;
  // Spread evenly over the sphere, about 25 degrees apart; the shortest way is then sought in between.
  static constexpr int kDirections = 64;
  // A way that turns out longer than the shortest by less than this factor may lead across the nearest surface, only
  // aslant.
  static constexpr double kAslant = 1.3;
  static constexpr double kShortestStepM = 0.005;
  static constexpr int kMostSteps = 64;

  // Tries a direction, and then the one straight across the surface that it leaves.
  void try_way(const glm::dvec3& direction) {
    const auto there_m = first_free_m(direction, kAslant * least_m_);
    if (!there_m) return;
    take(*there_m);
    glm::dvec3 surface_m;
    if (!field_.nearest(*there_m, 2 * room_m_, surface_m) || surface_m == *there_m) return;
    const glm::dvec3 across_m = *there_m - surface_m;
    if (const auto straight_m = first_free_m(glm::normalize(across_m), least_m_)) take(*straight_m);
  }

  // The directions of a Fibonacci lattice.
  static glm::dvec3 spread_direction(int i) {
    const double y = 1 - (2 * i + 1.0) / kDirections, turn = i * std::numbers::pi * (3 - std::sqrt(5.0));
    const double flat = std::sqrt(1 - y * y);
    return {flat * std::cos(turn), y, flat * std::sin(turn)};
  }

  // Tries directions round the best one, `aside` radians apart. Where several surfaces leave little room, the shortest
  // way is across none of them.
  void try_beside(double aside) {
    if (!found_m_) return;
    const glm::dvec3 best = glm::normalize(*found_m_ - from_m_);
    const glm::dvec3 across = glm::normalize(
        glm::cross(best, std::abs(best.y) < 0.9 ? glm::dvec3(0, 1, 0) : glm::dvec3(1, 0, 0)));
    const glm::dvec3 other = glm::cross(best, across);
    for (int i = 0; i < 8; ++i) {
      const double turn = i * std::numbers::pi / 4;
      const glm::dvec3 direction = glm::normalize(best + aside * (std::cos(turn) * across + std::sin(turn) * other));
      if (const auto there_m = first_free_m(direction, least_m_)) take(*there_m);
    }
  }

  void take(const glm::dvec3& place_m) {
    const double distance_m = glm::distance(from_m_, place_m);
    if (distance_m >= least_m_) return;
    size_t blocker = ClearanceField::kNoBlocker;
    if (!inside_ && !field_.is_free(from_m_, place_m, 0.0, blocker)) return;
    least_m_ = distance_m, found_m_ = place_m;
  }

  // Goes as far in each step as no free place can be nearer. From inside a solid the ball has to pass the nearest
  // surface whole.
  std::optional<glm::dvec3> first_free_m(const glm::dvec3& direction, double most_m) const {
    double gone_m = first_step_m_;
    for (int step = 0; step < kMostSteps && gone_m <= most_m; ++step) {
      const glm::dvec3 place_m = from_m_ + gone_m * direction;
      const double least_step_m = step_m(place_m, field_.is_inside(place_m));
      if (least_step_m < kTightM) return place_m;
      gone_m += std::max(least_step_m, kShortestStepM);
    }
    return std::nullopt;
  }
  // No free place is nearer than this; at most 0 if the place itself is free.
  double step_m(const glm::dvec3& place_m, bool inside) const {
    const double clearance_m = field_.clearance_m(place_m, 4 * room_m_);
    return inside ? clearance_m + room_m_ : room_m_ - clearance_m;
  }
  static constexpr double kTightM = 1e-6;  // rounding

  const ClearanceField& field_;
  const glm::dvec3 from_m_;
  const double room_m_;
  const bool inside_;
  const double first_step_m_;
  double least_m_;  // of the ways that were found
  std::optional<glm::dvec3> found_m_;
};

struct Evasion {
  const CameraState& camera;
  const CameraLimits& limits;
  const MoversAhead& movers;
  const ClearanceField& field;  // colliders as they are now
  double enough_m;              // of room

  // The camera's position when it approaches a velocity with all its acceleration.
  glm::dvec3 position_m(const glm::dvec3& velocity_mps, double after_s) const {
    const glm::dvec3 change_mps = velocity_mps - camera.velocity_mps;
    const double change_s = glm::length(change_mps) / limits.max_acceleration_mps2;
    const double gained_s = after_s < change_s ? after_s * after_s / (2 * change_s) : after_s - change_s / 2;
    return camera.pose.position_m + camera.velocity_mps * after_s + change_mps * gained_s;
  }
  // The least distance to a collider at the times of kEvadeS, at most `enough_m`.
  double room_m(const glm::dvec3& velocity_mps) const {
    double room_m = enough_m;
    for (size_t look = 0; look < movers.size(); ++look) {
      const glm::dvec3 at_m = position_m(velocity_mps, kEvadeS[look]);
      room_m = std::min(room_m, movers[look].clearance_m(at_m, room_m));
      room_m = std::min(room_m, field.clearance_m(at_m, room_m));
    }
    return room_m;
  }
};

// `velocity_mps` if it leaves the body room; else the velocity towards the side with the most. The straight way from a
// mover may end at a wall, such as that of a doorway whose door shuts.
glm::dvec3 roomier(const Evasion& evasion, const glm::dvec3& velocity_mps, double body_m) {
  double most_m = evasion.room_m(velocity_mps);
  if (most_m >= body_m) return velocity_mps;
  const double speed_mps = std::min(evasion.limits.max_speed_mps,
                                    evasion.limits.max_acceleration_mps2 * kEvadeS.back());
  glm::dvec3 best_mps = velocity_mps;
  for (int x = -1; x <= 1; ++x)
    for (int y = -1; y <= 1; ++y)
      for (int z = -1; z <= 1; ++z) {
        if (x == 0 && y == 0 && z == 0) continue;
        const glm::dvec3 there_mps = glm::normalize(glm::dvec3(x, y, z)) * speed_mps;
        if (const double room_m = evasion.room_m(there_mps); room_m > most_m) most_m = room_m, best_mps = there_mps;
      }
  return best_mps;
}

}  // namespace

double swept_radius_m(const CameraLimits& limits, const Lens& lens) {
  return std::max(limits.body_radius_m, near_corner_distance_m(lens));
}

StraightWays::StraightWays(const ClearanceField& field, const glm::dvec3& from_m, double body_radius_m)
    : field_(field),
      from_m_(from_m),
      sweep_m_(sweep_radius_m(field.clearance_m(from_m, clearance_reach_m(body_radius_m)), body_radius_m)) {}

glm::dvec3 evade(const CameraState& camera, const glm::dvec3& wanted_mps, const CameraLimits& limits, const Lens& lens,
                 const MoversAhead& movers, const ClearanceField& field, double dt_s) {
  const double body_m = swept_radius_m(limits, lens), keep = body_m + kEvadeRoomM;
  glm::dvec3 velocity = wanted_mps;
  // A few rounds, because moving away from one collider may lead towards another.
  for (int round = 0; round < 3; ++round) {
    for (size_t look = 0; look < movers.size(); ++look) {
      const glm::dvec3 there = camera.pose.position_m + velocity * kEvadeS[look];
      glm::dvec3 surface;
      if (!movers[look].nearest(there, keep, surface)) continue;
      const double distance = glm::distance(there, surface);
      if (distance > 1e-6) velocity += (there - surface) * ((keep - distance) / distance / kEvadeS[look]);
    }
  }
  if (velocity != wanted_mps) velocity = roomier({camera, limits, movers, field, keep}, velocity, body_m);
  return clamp_velocity(camera.velocity_mps, velocity, limits, dt_s);
}

std::optional<glm::dvec3> way_out(const ClearanceField& field, const glm::dvec3& from_m, double body_radius_m) {
  return WayOut(field, from_m, body_radius_m + kBodySkinM).find();
}

SafeMove make_safe(const CameraState& camera, const glm::dvec3& wanted_mps, const CameraLimits& limits,
                   const Lens& lens, const ClearanceField& field, double dt_s, bool blind) {
  SafetyCheck check(camera, limits, lens, field, dt_s);
  const bool overlaps = check.overlaps();
  const bool inside = (overlaps || blind) && field.is_inside(camera.pose.position_m);
  if (inside || (overlaps && check.is_wedged()))
    if (const auto out_m = way_out(field, camera.pose.position_m, swept_radius_m(limits, lens)))
      return {velocity_towards(camera, *out_m, glm::dvec3(0.0), limits, dt_s), true};
  if (overlaps) return {roomiest(check), true};
  if (check.is_safe(wanted_mps)) return {wanted_mps, false};
  // Too close to a surface: away from it first, unless another surface is opposite.
  if (const glm::dvec3 out = check.limited(check.velocity_out()); !check.has_skin() && check.is_safe(out))
    return {out, false};
  const glm::dvec3 slide = check.along_surface(wanted_mps);
  const std::array<glm::dvec3, 6> tries = {slide,       0.5 * slide,      0.5 * wanted_mps,
                                           0.2 * slide, 0.2 * wanted_mps, 0.05 * slide};
  for (const glm::dvec3& velocity : tries)
    if (const glm::dvec3 v = check.limited(velocity); check.is_safe(v)) return {v, false};
  return {check.has_skin() ? check.limited(glm::dvec3(0.0)) : roomiest(check), false};
}

}  // namespace sightline
