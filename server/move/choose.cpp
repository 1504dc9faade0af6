#include "server/move/choose.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "server/base/check.h"

namespace sightline {
namespace {

constexpr double kHalfPi = std::numbers::pi / 2;

// The distance from the centre, along unit `outwards`, at which the whole group fits the picture.
double fitting_distance_m(std::span<const TargetView> targets, const glm::dvec3& center_m,
                          const glm::dvec3& outwards, const Lens& lens, double margin) {
  const glm::dquat camera = look_rotation(-outwards, {0, 1, 0}, {1, 0, 0});
  const double half_y = lens.vertical_fov_rad / 2 * (1 - margin),
               half_x = half_horizontal_fov_rad(lens) * (1 - margin);
  double distance = 0;
  for (const TargetView& t : targets) {
    if (!t.steered()) continue;
    const glm::dvec3 p = glm::conjugate(camera) * (t.aim_m - center_m);
    // A sphere touches the frustum's side when its centre is r / sin(half) behind the corner that it would fill.
    distance = std::max({distance, p.z + std::abs(p.x) / std::tan(half_x) + t.radius_m / std::sin(half_x),
                         p.z + std::abs(p.y) / std::tan(half_y) + t.radius_m / std::sin(half_y)});
  }
  return distance;
}

double elevation_rad(const glm::dvec3& from_center) {
  return std::atan2(from_center.y, std::hypot(from_center.x, from_center.z));
}

glm::dvec3 with_elevation(const glm::dvec3& offset, double elevation) {
  const double length = glm::length(offset), flat = std::hypot(offset.x, offset.z);
  const glm::dvec2 heading = flat > 1e-9 ? glm::dvec2(offset.x, offset.z) / flat : glm::dvec2(0, 1);
  const glm::dvec2 level = heading * (length * std::cos(elevation));
  return {level.x, length * std::sin(elevation), level.y};
}

struct Weights {
  double required = 0, optional = 0;
};
Weights weight_seen(uint32_t visible, std::span<const TargetView> targets) {
  Weights sum;
  for (size_t i = 0; i < targets.size(); ++i)
    if (visible >> i & 1u) (targets[i].required ? sum.required : sum.optional) += targets[i].weight;
  return sum;
}

uint32_t steered_mask(std::span<const TargetView> targets) {
  uint32_t mask = 0;
  for (size_t i = 0; i < targets.size(); ++i)
    if (targets[i].steered()) mask |= 1u << i;
  return mask;
}

// Orders candidates for a choice and tries the best ones for reachability.
class Search {
 public:
  Search(const CandidateSet& candidates, std::span<const TargetView> targets, std::span<const double> cost,
         double ahead_weight, const MoveSettings& settings, const Reachable& reachable, ChoiceScratch& scratch)
      : candidates_(candidates),
        targets_(targets),
        cost_(cost),
        ahead_weight_(ahead_weight),
        limits_(targets, settings),
        reachable_(reachable),
        keys_(scratch.keys) {}

  // Keeps the kMaxReachTests best of those that are wanted; false when none is. Most candidates are worse than all that are kept
  // by what they see and cost alone: whether they are within the limits need not be known.
  template <typename Wanted>
  bool collect(Wanted wanted) {
    keys_.clear();
    for (uint32_t i = 0; i < candidates_.size(); ++i) {
      if (!wanted(candidates_.filtered_targets[i])) continue;
      const Weights weights = weight_of(i);
      ChoiceKey key{weights.required, weights.optional, cost_[i], i, true};
      const bool full = keys_.size() == kMaxReachTests;
      if (full && !better(key, keys_.front())) continue;
      key.within_limits = limits_.hold(candidates_.position_m[i]);
      if (full && !better(key, keys_.front())) continue;
      if (full) std::pop_heap(keys_.begin(), keys_.end(), better), keys_.pop_back();
      keys_.push_back(key);
      std::push_heap(keys_.begin(), keys_.end(), better);
    }
    return !keys_.empty();
  }

  // The first reachable of those kept, best first; -1 when none is.
  int best() {
    std::sort_heap(keys_.begin(), keys_.end(), better);
    for (const ChoiceKey& key : keys_)
      if (reachable_(candidates_.position_m[key.candidate])) return static_cast<int>(key.candidate);
    return -1;
  }

 private:
  static bool better(const ChoiceKey& a, const ChoiceKey& b) {
    if (a.required != b.required) return a.required > b.required;
    if (a.optional != b.optional) return a.optional > b.optional;
    if (a.within_limits != b.within_limits) return a.within_limits;
    return a.cost != b.cost ? a.cost < b.cost : a.candidate < b.candidate;
  }

  Weights weight_of(uint32_t candidate) {
    const Weights now = now_.of(candidates_.filtered_targets[candidate], targets_);
    if (ahead_weight_ == 0) return now;
    const Weights ahead = ahead_.of(candidates_.ahead_targets[candidate], targets_);
    return {now.required * (1 - ahead_weight_) + ahead.required * ahead_weight_,
            now.optional * (1 - ahead_weight_) + ahead.optional * ahead_weight_};
  }

  // Places side by side mostly see the same: the last sum is kept.
  struct LastWeights {
    uint32_t visible = 0;
    Weights weights;  // of seeing nothing: none
    const Weights& of(uint32_t seen, std::span<const TargetView> targets) {
      if (seen != visible) visible = seen, weights = weight_seen(seen, targets);
      return weights;
    }
  };

  const CandidateSet& candidates_;
  std::span<const TargetView> targets_;
  std::span<const double> cost_;
  const double ahead_weight_;
  const PlaceLimits limits_;
  const Reachable& reachable_;
  std::vector<ChoiceKey>& keys_;  // a heap, the worst first
  LastWeights now_, ahead_;
};

}  // namespace

Status validate(const MoveSettings& s) {
  if (auto ok = check_range("move.prediction_s", s.prediction_s, 0, 2); !ok) return ok;
  if (auto ok = check_range("move.predictive_power", s.predictive_power, 0, 1); !ok) return ok;
  if (auto ok = validate(s.blend); !ok) return ok;
  if (auto ok = validate(s.survey); !ok) return ok;
  if (auto ok = validate(s.coherence); !ok) return ok;
  if (auto ok = check_range("move.turn_share", s.turn_share, 0, 0.5); !ok) return ok;
  if (auto ok = check_range("move.turn_rad", s.turn_rad, 0, kHalfPi); !ok) return ok;
  if (auto ok = check_range("move.response_s", s.response_s, 0, 1); !ok) return ok;
  if (auto ok = check_range("move.min_distance_m", s.min_distance_m, 0, 1000); !ok) return ok;
  if (auto ok = check_above("move.max_distance_m", s.max_distance_m, s.min_distance_m, 10000); !ok) return ok;
  if (auto ok = check_range("move.min_elevation_rad", s.min_elevation_rad, -kHalfPi, kHalfPi); !ok) return ok;
  return check_above("move.max_elevation_rad", s.max_elevation_rad, s.min_elevation_rad, kHalfPi + 1e-9);
}

glm::dvec3 weighted_center_m(std::span<const TargetView> targets) {
  glm::dvec3 sum(0.0);
  double weight = 0;
  for (const TargetView& t : targets)
    if (t.steered()) sum += t.weight * t.aim_m, weight += t.weight;
  return sum / weight;
}

glm::dvec3 desired_place_m(std::span<const TargetView> targets, const glm::dvec3& offset_m, const Lens& lens,
                           double framing_margin, const MoveSettings& settings) {
  const glm::dvec3 center = weighted_center_m(targets);
  glm::dvec3 offset = glm::length(offset_m) > 1e-6 ? offset_m : glm::dvec3(0, 0, 1e-3);
  if (settings.follow == Follow::kStay) return center + offset_m;
  const double elevation =
      std::clamp(elevation_rad(offset), settings.min_elevation_rad, settings.max_elevation_rad);
  offset = with_elevation(offset, elevation);
  const glm::dvec3 outwards = glm::normalize(offset);
  double nearest_allowed = fitting_distance_m(targets, center, outwards, lens, framing_margin);
  for (const TargetView& t : targets)
    if (t.steered())
      nearest_allowed =
          std::max(nearest_allowed, glm::dot(t.aim_m - center, outwards) + settings.min_distance_m);
  const double distance = std::min(std::max(glm::length(offset), nearest_allowed), settings.max_distance_m);
  return center + outwards * distance;
}

PlaceLimits::PlaceLimits(std::span<const TargetView> targets, const MoveSettings& settings)
    : targets_(targets),
      settings_(settings),
      center_m_(weighted_center_m(targets)),
      low_(std::cos(settings.min_elevation_rad), std::sin(settings.min_elevation_rad)),
      high_(std::cos(settings.max_elevation_rad), std::sin(settings.max_elevation_rad)) {}

// An elevation e is over a limit l when sin(e - l), which is y cos l - flat sin l over the distance, is above 0: no arc has to be
// taken unless it is within rounding of 0.
bool PlaceLimits::hold(const glm::dvec3& place_m) const {
  for (const TargetView& t : targets_)
    if (t.steered() && glm::distance(place_m, t.aim_m) < settings_.min_distance_m) return false;
  const glm::dvec3 from_center = place_m - center_m_;
  const double distance_m = glm::length(from_center);
  if (!(distance_m <= settings_.max_distance_m)) return false;
  const double flat_m = std::sqrt(from_center.x * from_center.x + from_center.z * from_center.z);
  const double over_low = from_center.y * low_.x - flat_m * low_.y, over_high = from_center.y * high_.x - flat_m * high_.y;
  const double rounding_m = 1e-12 * distance_m;
  if (over_low < -rounding_m || over_high > rounding_m) return false;
  if (over_low > rounding_m && over_high < -rounding_m) return true;
  return within_limits(place_m, targets_, settings_);
}

bool within_limits(const glm::dvec3& place_m, std::span<const TargetView> targets,
                   const MoveSettings& settings) {
  for (const TargetView& t : targets)
    if (t.steered() && glm::distance(place_m, t.aim_m) < settings.min_distance_m) return false;
  const glm::dvec3 from_center = place_m - weighted_center_m(targets);
  const double elevation = elevation_rad(from_center);
  return glm::length(from_center) <= settings.max_distance_m && elevation >= settings.min_elevation_rad &&
         elevation <= settings.max_elevation_rad;
}

Choice choose_place(const CandidateSet& candidates, std::span<const TargetView> targets,
                    std::span<const double> cost, const glm::dvec3& desired_m, double ahead_weight,
                    const MoveSettings& settings, const Reachable& reachable, ChoiceScratch& scratch) {
  const uint32_t steered = steered_mask(targets);
  if (steered == 0) return {MoveStatus::kHolding, MoveReason::kNoTargets, -1};
  Search search(candidates, targets, cost, ahead_weight, settings, reachable, scratch);

  const bool any_all = search.collect([=](uint32_t seen) { return (seen & steered) == steered; });
  if (any_all) {
    if (const int best = search.best(); best >= 0) {
      const bool desired = glm::distance(candidates.position_m[best], desired_m) < 1e-6;
      return {MoveStatus::kTracking, desired ? MoveReason::kAtDesiredPlace : MoveReason::kNearestAllVisible,
              best};
    }
  }
  const bool any_some =
      search.collect([=](uint32_t seen) { return (seen & steered) != 0 && (seen & steered) != steered; });
  if (any_some) {
    if (const int best = search.best(); best >= 0)
      return {MoveStatus::kPartial, MoveReason::kBestPartial, best};
  }
  if (any_all || any_some) return {MoveStatus::kHolding, MoveReason::kBlockedByGeometry, -1};

  search.collect([](uint32_t) { return true; });
  return {MoveStatus::kEscaping, MoveReason::kHorizonGrown, search.best()};
}

Choice choose_least(const CandidateSet& candidates, std::span<const TargetView> targets,
                    std::span<const double> cost, const glm::dvec3& desired_m) {
  const uint32_t steered = steered_mask(targets);
  if (steered == 0 || cost.empty()) return {MoveStatus::kHolding, MoveReason::kNoTargets, -1};
  const auto best = std::min_element(cost.begin(), cost.end()) - cost.begin();
  if (std::isinf(cost[best])) return {MoveStatus::kHolding, MoveReason::kBlockedByGeometry, -1};
  const auto candidate = static_cast<int>(best);
  const uint32_t seen = candidates.filtered_targets[best] & steered;
  if (seen == 0) return {MoveStatus::kEscaping, MoveReason::kHorizonGrown, candidate};
  if (seen != steered) return {MoveStatus::kPartial, MoveReason::kBestPartial, candidate};
  const bool desired = glm::distance(candidates.position_m[best], desired_m) < 1e-6;
  return {MoveStatus::kTracking, desired ? MoveReason::kAtDesiredPlace : MoveReason::kBestAllVisible,
          candidate};
}

Choice choose_basic(const CandidateSet& candidates, std::span<const TargetView> targets,
                    const glm::dvec3& desired_m, const MoveSettings& settings, const Reachable& reachable,
                    ChoiceScratch& scratch) {
  std::vector<double> cost;
  basic_costs(candidates.position_m, desired_m, cost);
  return choose_place(candidates, targets, cost, desired_m, 0.0, settings, reachable, scratch);
}

}  // namespace sightline
