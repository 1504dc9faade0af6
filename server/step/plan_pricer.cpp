#include "server/step/plan_pricer.h"

#include <algorithm>

#include "server/move/picture_worth.h"
#include "server/move/sight_weight.h"

namespace sightline {
namespace {

// The cost of a place outside the limits of distance and elevation, metres. The limits go along with targets that move
// this far within a plan: a camera behind a car flies where the car is now, which is too near to it. Those of targets
// on foot stay where they are.
constexpr float kOutsideLimits = 100.0f;
constexpr double kLimitsMoveM = 4.0;
// A shot that is nearer than this to the middle of its subjects has no direction.
constexpr double kNowhereM = 0.05;

}  // namespace

PlanPricer::PlanPricer(const MoveInput& in, const FlightSettings& flight, MoveScratch& scratch)
    : in_(in),
      planner_(scratch.planner),
      flight_(flight),
      outside_(scratch.outside),
      doors_(scratch.behind_doors),
      weights_(in.step.input.settings.move.cost),
      ahead_(in.carried.candidates.ahead),
      lattice_(in.carried.candidates.lattice),
      group_mps_(group_velocity_mps(in.step)),
      count_(effective_count(in.step.targets.sight_weights)) {
  // The distance from the desired position counts less, by the square of the factor. Few places show many targets. A
  // camera that is drawn away from them again and again does not show them, and is not calm.
  const double factor = several_factor(count_);
  occlusion_ = weights_.occlusion * factor, tolerance_ = weights_.tolerance / factor,
  distance_ = weights_.distance / (factor * factor);
  const MoveSettings& settings = in.step.input.settings.move;
  shot_ = weights_.occlusion * settings.keep_shot * in.carried.shot.weight;
  const glm::dvec3 asked_m = framed_offset_m(in.step,
                                             in.carried.shot.in_line_m.value_or(in.carried.shot.asked_offset_m)) -
                             in.carried.shot.subjects_m;
  if (settings.follow == Follow::kOffset && shot_ > 0 && glm::length(asked_m) > kNowhereM) asked_m_ = asked_m;
  if (targets_stand(in.step))
    tolerance_ = std::max(tolerance_,
                          picture_loss(good_enough_share(settings.viewpoint_search.keep_shot_below, count_), count_));
}

void PlanPricer::price() {
  for (const TrackedTarget& target : in_.step.targets.tracked_targets) targets_.push_back(target);
  price_limits();
  list_open_doors();
  const double fastest_mps = fastest_target_mps();
  guesses_ahead_ = fastest_mps * ahead_.ahead_s(kSlices - 1) <= kLimitsMoveM;
  double limits_at_s = 0;
  for (size_t slice = 0; slice < kSlices; ++slice) {
    const double passed_s = ahead_.ahead_s(slice) - limits_at_s;
    if (passed_s * fastest_mps > kLimitsMoveM) {
      limits_at_s += passed_s;
      move_limits(passed_s);
    }
    price_hidden(slice);
    planner_.blur(slice, weights_.surroundings);
    if (slice + 1 == kSlices) planner_.look_beyond(flight_);
    planner_.add_distances(slice, in_.desired_m + group_mps_ * ahead_.ahead_s(slice), distance_, outside_);
    if (!asked_m_) continue;
    const glm::dvec3 center_m = in_.step.center_m() + in_.carried.shot.subjects_m + group_mps_ * ahead_.ahead_s(slice);
    planner_.add_shot_losses(slice, center_m, *asked_m_, in_.step.input.settings.move.shot, shot_,
                             in_.carried.shot.tolerance);
  }
}

bool PlanPricer::is_in_free_bands(const glm::dvec3& place_m, double ahead_s) const {
  const WantedShot& shot = in_.carried.shot;
  const glm::dvec3 asked_m = shot.asked_offset_m - shot.subjects_m,
                   now_m = place_m - (in_.step.center_m() + shot.subjects_m + group_mps_ * ahead_s);
  if (in_.step.input.settings.move.follow != Follow::kOffset || glm::length(asked_m) < kNowhereM ||
      glm::length(now_m) < kNowhereM)
    return false;
  const double fov_rad = in_.step.lens.vertical_fov_rad;
  return within_free_bands(deviation_between(shot_from(asked_m, fov_rad), shot_from(now_m, fov_rad), shot.tolerance));
}

void PlanPricer::price_hidden(size_t slice) {
  const std::span<float> costs = planner_.costs(slice);
  const std::span<const SharePart> shares = ahead_.shares(slice);
  const std::vector<uint32_t>& addresses = lattice_.addresses();
  const auto occlusion = static_cast<float>(occlusion_), tolerance = static_cast<float>(tolerance_);
  find_hidden_by_doors(slice);
  for (size_t i = 0; i < addresses.size(); ++i) {
    const SharePart known = shares[addresses[i]];
    float share = known == kUnknownShare ? guessed_share(i, slice) : known * (1.0f / kWholeShare);
    if (!doors_.open.empty() && doors_.of_targets[i] > 0)
      share = std::max(share, static_cast<float>(picture_loss(doors_.of_targets[i], count_)));
    costs[planner_.cell_of(i)] = occlusion * std::max(0.0f, share - tolerance);
  }
}

void PlanPricer::list_open_doors() {
  doors_.open.clear();
  if (in_.step.targets.steered == 0) return;
  doors_.open = in_.carried.doors.open(in_.bound.center_m, in_.bound.radius_m, in_.step.center_m());
  if (doors_.open.empty()) return;
  const size_t count = lattice_.size();
  doors_.x_m.resize(count), doors_.y_m.resize(count), doors_.z_m.resize(count);
  for (size_t i = 0; i < count; ++i) {
    const glm::vec3 place_m(in_.sights.position_m[i] - in_.bound.center_m);
    doors_.x_m[i] = place_m.x, doors_.y_m[i] = place_m.y, doors_.z_m[i] = place_m.z;
  }
}

void PlanPricer::find_hidden_by_doors(size_t slice) {
  if (doors_.open.empty()) return;
  const Places places{doors_.x_m.data(), doors_.y_m.data(), doors_.z_m.data(), in_.bound.center_m};
  double weights = 0;
  for (const TrackedTarget& t : in_.step.targets.tracked_targets) weights += t.weight;
  doors_.of_targets.assign(lattice_.size(), 0.0f);
  for (const TrackedTarget& t : in_.step.targets.tracked_targets) {
    if (!t.steered()) continue;
    doors_.of_target.assign(lattice_.size(), 0.0f);
    const glm::dvec3 then_m = t.aim_m + t.velocity_mps * ahead_.ahead_s(slice);
    for (const OpenDoor& door : doors_.open) hide_behind(door, places, then_m, doors_.of_target);
    const auto part = static_cast<float>(t.weight / weights);
    for (size_t i = 0; i < doors_.of_targets.size(); ++i) doors_.of_targets[i] += part * doors_.of_target[i];
  }
}

// Of a cell that is new to the lattice, some slices are not known yet. The share that is hidden there now says little
// of later times. If that alone counted, the camera would chase the edge of the bound while all other places are
// about to lose their sight. Behind a fast target it does count alone, because all places at the front of the bound
// are new there, and the camera will be beyond them.
float PlanPricer::guessed_share(size_t candidate, size_t slice) const {
  const auto now = static_cast<float>(picture_loss(in_.sights.hidden[candidate], count_));
  if (!guesses_ahead_) return now;
  const SharePart near = ahead_.nearest_known(slice, lattice_.addresses()[candidate]);
  return near == kUnknownShare ? now : std::max(now, near * (1.0f / kWholeShare));
}

double PlanPricer::fastest_target_mps() const {
  double fastest_mps = 0;
  for (const TrackedTarget& t : targets_)
    if (t.steered()) fastest_mps = std::max(fastest_mps, glm::length(t.velocity_mps));
  return fastest_mps;
}

void PlanPricer::move_limits(double time_s) {
  for (TrackedTarget& t : targets_) t.aim_m += t.velocity_mps * time_s;
  price_limits();
}

void PlanPricer::price_limits() {
  const PlaceLimits limits(targets_, in_.step.input.settings.move);
  outside_.assign(planner_.cell_count(), 0.0f);
  for (size_t i = 0; i < lattice_.size(); ++i)
    if (!limits.hold(in_.sights.position_m[i])) outside_[planner_.cell_of(i)] = kOutsideLimits;
}

}  // namespace sightline
