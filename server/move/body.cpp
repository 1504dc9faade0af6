#include "server/move/body.h"

#include <algorithm>
#include <array>

#include "server/move/motion.h"

namespace sightline {
namespace {

// Sweeps start this much inside the measured clearance, so that a camera that touches its skin can still slide.
constexpr double kSweepSlackM = 0.002;

// Room kept to what moves, beyond the body: a mover's velocity is only what it was.
constexpr double kEvadeRoomM = 0.1;

// The radius to sweep from here: with the whole skin where there is room for it, less where the camera already stands closer.
double sweep_radius_m(const ClearanceField& field, const glm::dvec3& from_m, double body_m) {
  const double clearance = field.clearance_m(from_m, body_m + 2 * kBodySkinM);
  return std::clamp(clearance - kSweepSlackM, body_m, body_m + kBodySkinM);
}

class SafetyCheck {
 public:
  SafetyCheck(const CameraState& camera, const CameraLimits& limits, const Lens& lens,
              const ClearanceField& field, double dt_s)
      : camera_(camera),
        limits_(limits),
        field_(field),
        dt_s_(dt_s),
        body_m_(swept_radius_m(limits, lens)),
        sweep_m_(sweep_radius_m(field, camera.pose.position_m, body_m_)) {}

  double body_m() const { return body_m_; }

  // Free for the step and for the brake after it.
  bool is_safe(const glm::dvec3& velocity) const {
    const double speed = glm::length(velocity);
    if (speed < 1e-9) return true;
    const double reach = speed * dt_s_ + braking_distance_m(velocity, limits_);
    const glm::dvec3 from = camera_.pose.position_m;
    return field_.free_fraction(from, from + velocity * (reach / speed), sweep_m_) >= 1.0;
  }

  // The velocity without its part into the surface that it meets.
  glm::dvec3 along_surface(const glm::dvec3& velocity) const {
    const glm::dvec3 from = camera_.pose.position_m;
    const double speed = glm::length(velocity);
    const double reach = speed * dt_s_ + braking_distance_m(velocity, limits_);
    const glm::dvec3 to = from + velocity * (reach / std::max(speed, 1e-9));
    const glm::dvec3 stop = from + (to - from) * field_.free_fraction(from, to, sweep_m_);
    glm::dvec3 surface;
    if (!field_.nearest(stop, sweep_m_ + 0.1, surface)) return velocity;
    const glm::dvec3 out = glm::normalize(stop - surface);
    return velocity - out * std::min(0.0, glm::dot(velocity, out));
  }

  glm::dvec3 limited(const glm::dvec3& wanted) const {
    return clamp_velocity(camera_.velocity_mps, wanted, limits_, dt_s_);
  }

 private:
  const CameraState& camera_;
  const CameraLimits& limits_;
  const ClearanceField& field_;
  const double dt_s_, body_m_, sweep_m_;
};

// Away from the nearest surface, as fast as still allows stopping within a body's length.
glm::dvec3 velocity_out(const glm::dvec3& place, const glm::dvec3& surface, double body_m,
                        const CameraLimits& limits) {
  const glm::dvec3 away = place - surface;
  const double distance = glm::length(away);
  if (distance < 1e-9) return glm::dvec3(0, 1, 0);
  const double missing = body_m + kBodySkinM - distance;
  return away / distance * std::sqrt(2 * limits.max_acceleration_mps2 * std::max(missing, 0.0));
}

}  // namespace

double swept_radius_m(const CameraLimits& limits, const Lens& lens) {
  return std::max(limits.body_radius_m, near_corner_distance_m(lens));
}

bool path_is_free(const ClearanceField& field, const glm::dvec3& from_m, const glm::dvec3& to_m,
                  double body_radius_m) {
  const double radius = sweep_radius_m(field, from_m, body_radius_m);
  return field.free_fraction(from_m, to_m, radius) >= 1.0;
}

glm::dvec3 evade(const CameraState& camera, const glm::dvec3& wanted_mps, const CameraLimits& limits,
                 const Lens& lens, const MoversAhead& movers, double dt_s) {
  const double keep = swept_radius_m(limits, lens) + kEvadeRoomM;
  glm::dvec3 velocity = wanted_mps;
  // A few rounds: what leads away from one collider may lead towards another.
  for (int round = 0; round < 3; ++round) {
    for (size_t look = 0; look < movers.size(); ++look) {
      const glm::dvec3 there = camera.pose.position_m + velocity * kEvadeS[look];
      glm::dvec3 surface;
      if (!movers[look].nearest(there, keep, surface)) continue;
      const double distance = glm::distance(there, surface);
      if (distance > 1e-6) velocity += (there - surface) * ((keep - distance) / distance / kEvadeS[look]);
    }
  }
  return clamp_velocity(camera.velocity_mps, velocity, limits, dt_s);
}

SafeMove make_safe(const CameraState& camera, const glm::dvec3& wanted_mps, const CameraLimits& limits,
                   const Lens& lens, const ClearanceField& field, double dt_s) {
  const SafetyCheck check(camera, limits, lens, field, dt_s);
  glm::dvec3 surface;
  if (field.nearest(camera.pose.position_m, check.body_m() + kSweepSlackM, surface)) {
    const glm::dvec3 out = velocity_out(camera.pose.position_m, surface, check.body_m(), limits);
    const double distance = glm::distance(camera.pose.position_m, surface);
    return {check.limited(out), distance < check.body_m(), true};
  }
  if (check.is_safe(wanted_mps)) return {wanted_mps, false, false};
  const glm::dvec3 slide = check.along_surface(wanted_mps);
  const std::array<glm::dvec3, 6> tries = {slide,       0.5 * slide,      0.5 * wanted_mps,
                                           0.2 * slide, 0.2 * wanted_mps, 0.05 * slide};
  for (const glm::dvec3& velocity : tries)
    if (const glm::dvec3 v = check.limited(velocity); check.is_safe(v)) return {v, false, true};
  return {check.limited(glm::dvec3(0.0)), false, true};
}

}  // namespace sightline
