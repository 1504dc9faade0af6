// The status of a step. It says which targets the camera sees. If the camera sees none, it says whether the camera is
// on the way to a view, and what is in the way.
#include <algorithm>
#include <cmath>
#include <limits>

#include "server/step/report.h"

namespace sightline {
namespace {

// A way shorter than this counts as arrived, metres.
constexpr double kArrivedM = 0.05;
// A slower turn counts as standing still, radians per second.
constexpr double kStillRadps = 0.01;
// The camera counts as stopped if it advances by less than this share of what it wants to.
constexpr double kLeastAdvance = 0.1;
// A camera that wants to move more slowly than this is not stopped by anything, metres per second.
constexpr double kLeastSpeedMps = 0.01;
// A target with less of its image in the picture does not count as seen.
constexpr double kLeastInPicture = 0.5;
// How far ahead a stopped camera looks for what stops it, metres.
constexpr double kLookM = 1.0;

// The least time to cover a distance from `rate` on, within the limits; all of one unit.
double time_to_cover_s(double distance, double rate, double most, double acceleration) {
  const double begin = std::clamp(rate, 0.0, most);
  const double until_most = (most * most - begin * begin) / (2 * acceleration);
  if (distance > until_most) return (most - begin) / acceleration + (distance - until_most) / most;
  return (std::sqrt(begin * begin + 2 * acceleration * distance) - begin) / acceleration;
}

class StatusFinder {
 public:
  StatusFinder(const ReportInput& step, const Lens& lens, StepResult& result)
      : step_(step), decision_(step.dump.decision), targets_(step.dump.targets), lens_(lens), result_(result) {}

  void find() {
    if (targets_.weighted == 0) return set(TrackingStatus::kHolding);
    if (sees_required()) return set(TrackingStatus::kTracking);
    if (any_of(targets_.weighted, [&](size_t i) { return glimpses(result_.targets[i]); }))
      return set(TrackingStatus::kPartialView);
    if (any_of(targets_.steered, [&](size_t i) { return result_.targets[i].visible_share > 0; })) return turn_to_view();
    if (decision_.view_way_m) return move_to_view();
    const SightCounts& counts = step_.dump.sights.counts;
    const bool any_candidate = counts.all_visible + counts.some_visible > 0;
    if (decision_.sees_none && decision_.nearest_view_m) return set_blocked(*decision_.nearest_view_m);
    set(any_candidate || !decision_.sees_none ? TrackingStatus::kWaiting : TrackingStatus::kLost);
  }

 private:
  void set(TrackingStatus status) { result_.status = status; }
  void set_blocked(const glm::dvec3& to_m) {
    set(TrackingStatus::kBlocked);
    const auto slot = step_.dump.surroundings.colliders.first_in_way(decision_.camera.pose.position_m, to_m,
                                                                     swept_radius_m(step_.input.limits, lens_));
    if (slot) result_.blocked_by = step_.input.scene.instances()[*slot].id;
  }

  template <typename Test>
  bool any_of(uint32_t mask, Test test) const {
    for (size_t i = 0; i < result_.targets.size(); ++i)
      if ((mask >> i & 1u) != 0 && test(i)) return true;
    return false;
  }
  bool sees_required() const {
    const bool any_required = any_of(targets_.weighted, [&](size_t i) { return targets_.tracked_targets[i].required; });
    return !any_of(targets_.weighted, [&](size_t i) {
      return (targets_.tracked_targets[i].required || !any_required) && !sees(result_.targets[i]);
    });
  }
  bool sees(const TargetSight& sight) const {
    const double threshold = step_.taken.settings.visibility_threshold - 1e-9;
    return sight.in_picture && sight.picture_share >= kLeastInPicture && sight.filtered_share > 0 &&
           sight.filtered_share >= threshold;
  }
  static bool glimpses(const TargetSight& sight) { return sight.picture_share > 0 && sight.filtered_share > 0; }

  // Some target is visible from here, but outside the picture.
  void turn_to_view() {
    const CameraState& camera = decision_.camera;
    const double rate_radps = glm::length(camera.angular_velocity_radps);
    if (rate_radps < kStillRadps) return set(TrackingStatus::kWaiting);
    set(TrackingStatus::kSeeking);
    double outside_rad = std::numeric_limits<double>::infinity();
    for (size_t i = 0; i < result_.targets.size(); ++i)
      if ((targets_.steered >> i & 1u) != 0 && result_.targets[i].visible_share > 0)
        outside_rad = std::min(outside_rad, outside_picture_rad(targets_.tracked_targets[i].aim_m));
    const CameraLimits& limits = step_.input.limits;
    result_.view_s = time_to_cover_s(outside_rad, rate_radps, limits.max_angular_speed_radps,
                                     limits.max_angular_acceleration_radps2);
  }
  // The angle by which the camera has to turn, sideways or up and down, until the point comes into the picture.
  double outside_picture_rad(const glm::dvec3& point_m) const {
    const glm::dvec3 p = inverse_transform_point(decision_.camera.pose, point_m);
    const double aside_rad = std::atan2(std::abs(p.x), -p.z),
                 over_rad = std::atan2(std::abs(p.y), std::hypot(p.x, p.z));
    return std::max({0.0, aside_rad - half_horizontal_fov_rad(lens_), over_rad - lens_.vertical_fov_rad / 2});
  }

  void move_to_view() {
    const CameraState& camera = decision_.camera;
    const double wanted_mps = glm::length(decision_.wanted_mps);
    if (is_stopped()) return set_blocked(camera.pose.position_m + decision_.wanted_mps * (kLookM / wanted_mps));
    if (*decision_.view_way_m < kArrivedM) return set(TrackingStatus::kWaiting);
    set(TrackingStatus::kSeeking);
    const CameraLimits& limits = step_.input.limits;
    // The way may bend, so the whole speed counts unless the camera flies the other way.
    const double rate_mps = glm::dot(camera.velocity_mps, decision_.wanted_mps) > 0 ? glm::length(camera.velocity_mps)
                                                                                    : 0.0;
    result_.view_s = time_to_cover_s(*decision_.view_way_m, rate_mps, limits.max_speed_mps,
                                     limits.max_acceleration_mps2);
  }
  bool is_stopped() const {
    const double wanted_mps = glm::length(decision_.wanted_mps);
    return decision_.deflected && wanted_mps > kLeastSpeedMps &&
           glm::dot(decision_.camera.velocity_mps, decision_.wanted_mps) < kLeastAdvance * wanted_mps * wanted_mps;
  }

  const ReportInput& step_;
  const Decision& decision_;
  const TargetsNow& targets_;
  const Lens& lens_;
  StepResult& result_;
};

}  // namespace

void set_tracking_status(const ReportInput& step, const Lens& lens, StepResult& result) {
  StatusFinder(step, lens, result).find();
}

}  // namespace sightline
