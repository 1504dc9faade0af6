#include "client/ceiling/sight.h"

#include <algorithm>
#include <cmath>

#include "client/truth/truth.h"

namespace sightline {
namespace {

// Targets this near to the middle of the picture, as a share of half its height, are in the picture for any aim at
// their middle.
constexpr double kSurelyInside = 0.8;
// A target whose first rays are all blocked counts as hidden.
constexpr size_t kFirstRays = 3;
// A ray ends this share of its length before the surface point, so that rounding does not let it hit what the target
// stands on.
constexpr float kRayEnd = 0.999f;

}  // namespace

ViewAngles best_aim(const glm::dvec3& eye_m, std::span<const TrackedTarget> targets, const ViewAngles& present,
                    const Lens& lens) {
  FramingSettings framing;
  framing.dead_zone = 0.0;
  return aim_at(eye_m, targets, present, lens, {.framing = framing}).angles;
}

std::vector<TrackedTarget> tracked_targets(const ScenarioWorld& world) {
  std::vector<TrackedTarget> targets;
  for (const Target& target : world.targets()) {
    const Instance& instance = *world.mirror().find(target.instance_id);
    targets.push_back({.aim_m = aim_point_m(instance), .radius_m = instance.radius_m, .weight = target.weight});
  }
  return targets;
}

SightEstimate::SightEstimate(const ScenarioWorld& world, ExtentCache& extents, const MoveSettings& limits, size_t rays)
    : world_(world), extents_(extents), limits_(limits), lens_(world.scenario().lens()), rays_(rays) {}

void SightEstimate::refresh(size_t turn) {
  first_point_ = turn * rays_ % kExtentPoints;
  targets_ = tracked_targets(world_);
  place_limits_.emplace(targets_, limits_);
  bodies_.clear();
  for (const Target& target : world_.targets()) {
    Body& body = bodies_.emplace_back();
    body.surface = extents_.get(world_.mirror().find(target.instance_id)->geometry);
    body.slot = *world_.mirror().slot_of(target.instance_id);
    body.layer_mask = target.layer_mask;
    body.world_from_mesh = world_.mirror().instances()[body.slot].world_from_instance;
    body.mesh_from_world = inverse(body.world_from_mesh);
  }
}

TargetsSeen SightEstimate::from(const glm::dvec3& eye_m) const {
  return is_allowed(eye_m) && fits(eye_m) ? shares(eye_m, rays_) : TargetsSeen{};
}

TargetsSeen SightEstimate::shares(const glm::dvec3& eye_m, size_t rays, size_t known_free) const {
  TargetsSeen sight{.allowed = true, .least_share = 1.0};
  for (const Body& body : bodies_) {
    const double seen = share(body, eye_m, rays, known_free);
    sight.mean_share += seen / static_cast<double>(bodies_.size());
    sight.least_share = std::min(sight.least_share, seen);
  }
  return sight;
}

double SightEstimate::share(const Body& body, const glm::dvec3& eye_m, size_t rays, size_t known_free) const {
  const auto points = body.surface->points(transform_point(body.mesh_from_world, eye_m));
  const RayFilter filter = filter_of(body);
  size_t seen = known_free;
  for (size_t k = known_free; k < rays; ++k) {
    if (k == kFirstRays && seen == 0) return 0.0;
    const glm::dvec3 point_m = transform_point(body.world_from_mesh, points[(first_point_ + k) % kExtentPoints]);
    seen += reaches(eye_m, point_m, filter);
  }
  return static_cast<double>(seen) / static_cast<double>(rays);
}

RayFilter SightEstimate::filter_of(const Body& body) const {
  RayFilter filter;
  filter.layer_mask = body.layer_mask;
  filter.ignored_slots = std::span(&body.slot, 1);
  return filter;
}

bool SightEstimate::reaches(const glm::dvec3& eye_m, const glm::dvec3& point_m, const RayFilter& filter) const {
  const glm::vec3 way(point_m - eye_m);
  const auto near = static_cast<float>(lens_.near_m / std::max(1e-3f, glm::length(way)));
  return !world_.occluders().is_blocked(eye_m, way, near, kRayEnd, filter);
}

double SightEstimate::whole_share(const Body& body, const Pose& world_from_camera, size_t rays) const {
  const glm::dvec3& eye_m = world_from_camera.position_m;
  const auto points = body.surface->points(transform_point(body.mesh_from_world, eye_m));
  const RayFilter filter = filter_of(body);
  size_t seen = 0;
  for (size_t k = 0; k < rays; ++k) {
    const glm::dvec3 point_m = transform_point(body.world_from_mesh, points[(first_point_ + k) % kExtentPoints]);
    seen += in_picture(world_from_camera, lens_, point_m) && reaches(eye_m, point_m, filter);
  }
  return static_cast<double>(seen) / static_cast<double>(rays);
}

double SightEstimate::whole_loss(const Pose& world_from_camera, size_t rays) const {
  double loss = 0.0;
  for (const Body& body : bodies_)
    loss += std::max(0.0, kLeastOfWhole - whole_share(body, world_from_camera, rays)) / kLeastOfWhole;
  return loss / static_cast<double>(bodies_.size());
}

bool SightEstimate::fits(const glm::dvec3& eye_m) const {
  const glm::dvec3 middle = glm::normalize(weighted_center_m(targets_) - eye_m);
  const double least_cosine = std::cos(kSurelyInside *
                                       std::min(lens_.vertical_fov_rad / 2, half_horizontal_fov_rad(lens_)));
  const bool surely = std::all_of(targets_.begin(), targets_.end(), [&](const TrackedTarget& target) {
    return glm::dot(glm::normalize(target.aim_m - eye_m), middle) > least_cosine;
  });
  if (surely) return true;
  const Pose pose{eye_m, rotation_from_angles(best_aim(eye_m, targets_, {}, lens_))};
  return std::all_of(targets_.begin(), targets_.end(),
                     [&](const TrackedTarget& target) { return in_picture(pose, lens_, target.aim_m); });
}

}  // namespace sightline
