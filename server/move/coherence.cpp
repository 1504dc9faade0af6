#include "server/move/coherence.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <string>
#include <utility>

#include "server/base/check.h"
#include "server/move/choose.h"
#include "server/move/sight_weight.h"

namespace sightline {
namespace {

constexpr double kMaxWeight = 100.0;
constexpr double kShortest = 1e-9;  // metres; a shorter vector has no direction

glm::dvec3 unit_or_zero(const glm::dvec3& v) {
  const double length = glm::length(v);
  return length > kShortest ? v / length : glm::dvec3(0.0);
}

// Angle between two directions; 0 when one is the zero vector. atan2 is exact for small angles, where acos is not.
double angle_between_directions(const glm::dvec3& a, const glm::dvec3& b) {
  if (a == glm::dvec3(0.0) || b == glm::dvec3(0.0)) return 0.0;
  return std::atan2(glm::length(glm::cross(a, b)), glm::dot(a, b));
}

glm::dvec3 direction_in_camera(const Pose& world_from_camera, const glm::dvec3& point_m) {
  return unit_or_zero(inverse_transform_point(world_from_camera, point_m));
}

// Mean weighted by the targets' weights; 0 when no target is steered.
double weighted_mean(std::span<const TrackedTarget> targets, auto value_of) {
  double sum = 0, weight = 0;
  for (size_t i = 0; i < targets.size(); ++i) {
    sum += targets[i].weight * value_of(i);
    weight += targets[i].weight;
  }
  return weight > 0 ? sum / weight : 0.0;
}

// The same with the weights of sight_weight.h, where required targets come first.
double mean_of_sights(std::span<const TrackedTarget> targets, auto value_of) {
  const double optional = optional_share(targets);
  double sum = 0, weight = 0;
  for (size_t i = 0; i < targets.size(); ++i) {
    const double counts = sight_weight(targets[i], optional);
    sum += counts * value_of(i);
    weight += counts;
  }
  return weight > 0 ? sum / weight : 0.0;
}

double total_weight(const CoherenceSettings& s) {
  return s.visibility + s.view_angle + s.height + s.distance + s.screen;
}

}  // namespace

void capture_shot(const Pose& world_from_camera, const Lens& lens, std::span<const TrackedTarget> targets,
                  std::span<const float> seen_share, ShotState& shot) {
  assert(seen_share.size() == targets.size());
  shot.from_center_m = world_from_camera.position_m - weighted_center_m(targets);
  shot.vertical_fov_rad = lens.vertical_fov_rad;
  shot.seen_share.assign(seen_share.begin(), seen_share.end());
  shot.direction.clear();
  for (const TrackedTarget& t : targets)
    shot.direction.push_back(direction_in_camera(world_from_camera, t.aim_m));
}

void shares_from_mask(uint32_t visible_targets, std::span<float> share) {
  for (size_t i = 0; i < share.size(); ++i) share[i] = visible_targets >> i & 1u ? 1.0f : 0.0f;
}

CoherenceTerms coherence_terms(const ShotCandidate& candidate, const ShotState& now,
                               std::span<const TrackedTarget> targets) {
  assert(targets.size() == now.direction.size() && targets.size() == candidate.seen_share.size());
  const glm::dvec3 then_m = candidate.world_from_camera.position_m - weighted_center_m(targets);
  const double far_now = std::max(glm::length(now.from_center_m), kShortest),
               far_then = std::max(glm::length(then_m), kShortest);
  CoherenceTerms terms;
  terms.visibility = mean_of_sights(targets, [&](size_t i) {
    return std::max(0.0,
                    static_cast<double>(now.seen_share[i]) - static_cast<double>(candidate.seen_share[i]));
  });
  terms.view_angle = angle_between_directions(unit_or_zero(now.from_center_m), unit_or_zero(then_m));
  terms.height = std::abs(then_m.y - now.from_center_m.y) / far_now;
  terms.distance = std::abs(std::log(far_then / far_now));
  terms.screen = weighted_mean(targets, [&](size_t i) {
    const glm::dvec3 then = direction_in_camera(candidate.world_from_camera, targets[i].aim_m);
    return angle_between_directions(now.direction[i], then) / (now.vertical_fov_rad / 2);
  });
  return terms;
}

double coherence_cost(const ShotCandidate& candidate, const ShotState& now,
                      std::span<const TrackedTarget> targets, const CoherenceSettings& s) {
  const CoherenceTerms t = coherence_terms(candidate, now, targets);
  const double sum = s.visibility * t.visibility + s.view_angle * t.view_angle + s.height * t.height +
                     s.distance * t.distance + s.screen * t.screen;
  return sum / total_weight(s);
}

double hidden_share(std::span<const TrackedTarget> targets, std::span<const float> seen_share) {
  assert(targets.size() == seen_share.size());
  return mean_of_sights(targets, [&](size_t i) { return 1.0 - static_cast<double>(seen_share[i]); });
}

double hidden_share_by_weight(std::span<const TrackedTarget> targets, std::span<const float> seen_share) {
  assert(targets.size() == seen_share.size());
  return weighted_mean(targets, [&](size_t i) { return 1.0 - static_cast<double>(seen_share[i]); });
}

double unseen_cost(const ShotCandidate& candidate, std::span<const TrackedTarget> targets, const CoherenceSettings& s) {
  const double risk = 1.0 - candidate.depth_share * (1.0 - candidate.hidden_ahead);
  const double hidden = hidden_share(targets, candidate.seen_share);
  return s.responsiveness * ((1.0 - s.predictive_power) * hidden + s.predictive_power * risk);
}

double shot_cost(const ShotCandidate& candidate, const ShotState& now, std::span<const TrackedTarget> targets,
                 const CoherenceSettings& s) {
  const double change = coherence_cost(candidate, now, targets, s);
  return unseen_cost(candidate, targets, s) + (1.0 - s.responsiveness) * change / (1.0 + change);
}

}  // namespace sightline
