// Estimates what a camera could see of the targets from many places, with a few rays to each target.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "client/scenario/scenario_world.h"
#include "server/move/choose.h"
#include "server/move/framing.h"
#include "server/move/motion.h"
#include "server/sample/extent.h"

namespace sightline {

// The aim from `eye_m` that shows all targets, without a dead zone. `present` is as in aim_at.
ViewAngles best_aim(const glm::dvec3& eye_m, std::span<const TrackedTarget> targets, const ViewAngles& present,
                    const Lens& lens);

// The targets of `world` as the aim and the distance limits need them. All count as required, since a picture counts
// only if it shows all.
std::vector<TrackedTarget> tracked_targets(const ScenarioWorld& world);

struct TargetsSeen {
  bool allowed = false;      // within the distance and elevation limits, and every target fits into the picture
  double mean_share = 0.0;   // mean visible share of the targets
  double least_share = 0.0;  // of the target that is seen least
};

// `world`, `extents` and `limits` must outlive the object. Used by one thread at a time.
class SightEstimate {
 public:
  // `rays`: number of rays to each target in `from`, [1, kExtentPoints].
  SightEstimate(const ScenarioWorld& world, ExtentCache& extents, const MoveSettings& limits, size_t rays);

  // Takes over the present time of the world, and its targets. The number `turn` selects the surface points of the
  // targets that are used.
  void refresh(size_t turn);
  TargetsSeen from(const glm::dvec3& eye_m) const;
  // The two parts of `from`. is_allowed returns whether the limits of distance and elevation hold. `shares` ignores the
  // picture's edges. If all of the first `known_free` rays are known to reach every target from here, they are not
  // traced again.
  bool is_allowed(const glm::dvec3& eye_m) const { return place_limits_->hold(eye_m); }
  TargetsSeen shares(const glm::dvec3& eye_m, size_t rays, size_t known_free = 0) const;
  // The visible share of one target of the world, by `rays` rays, [1, kExtentPoints].
  double target_share(size_t target, const glm::dvec3& eye_m, size_t rays) const {
    return share(bodies_[target], eye_m, rays, 0);
  }
  // Estimates sight_loss (client/truth/coherence.h) of a picture, [0, 1], with `rays` points of each body, [1,
  // kExtentPoints]. Hidden points and points outside the picture count alike. The limits of distance and elevation do
  // not count.
  double whole_loss(const Pose& world_from_camera, size_t rays) const;
  std::span<const TrackedTarget> targets() const { return targets_; }

 private:
  struct Body {
    std::shared_ptr<const ExtentTable> surface;
    Affine world_from_mesh, mesh_from_world;
    uint32_t slot = 0;
    uint32_t layer_mask = 0;
  };
  double share(const Body& body, const glm::dvec3& eye_m, size_t rays, size_t known_free) const;
  double whole_share(const Body& body, const Pose& world_from_camera, size_t rays) const;
  RayFilter filter_of(const Body& body) const;
  bool reaches(const glm::dvec3& eye_m, const glm::dvec3& point_m, const RayFilter& filter) const;
  bool fits(const glm::dvec3& eye_m) const;

  const ScenarioWorld& world_;
  ExtentCache& extents_;
  const MoveSettings& limits_;
  const Lens lens_;
  const size_t rays_;
  size_t first_point_ = 0;
  std::vector<Body> bodies_;
  std::vector<TrackedTarget> targets_;
  std::optional<PlaceLimits> place_limits_;
};

}  // namespace sightline
