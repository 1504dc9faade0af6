#include "server/move/shot.h"

#include <algorithm>
#include <array>
#include <limits>

#include "server/move/sight_weight.h"

namespace sightline {
namespace {

// How much a departure from the present shot counts beside one from the asked shot. Viewers bear a detour better than a
// jump of the eye.
constexpr double kChange = 0.3;
// The cost of a place beside the asked one, by its distance as a share of the asked distance. Within the free bands
// nothing else keeps to the asked one.
constexpr double kAside = 0.02;
// Shots are compared with one lens, so its field of view has no effect.
constexpr double kAnyFovRad = 1.0;

// What is known of a viewpoint, target by target.
struct SharesAt {
  std::array<float, kMaxTargets> seen, beside;
  size_t targets;

  SharesAt(const ViewpointMap& viewpoints, size_t target_count, size_t place) : targets(target_count) {
    for (size_t i = 0; i < targets; ++i)
      seen[i] = viewpoints.share(i, place), beside[i] = viewpoints.share_beside(i, place);
  }
  std::span<const float> seen_share() const { return std::span(seen).first(targets); }
  std::span<const float> share_beside() const { return std::span(beside).first(targets); }
};

class ShotCosts {
 public:
  ShotCosts(const ViewpointMap& viewpoints, std::span<const TrackedTarget> targets, const ShotWish& wish,
            const MoveSettings& settings)
      : viewpoints_(viewpoints),
        targets_(targets),
        settings_(settings),
        asked_m_(wish.asked_m),
        subjects_m_(wish.subjects_m),
        tolerance_(wish.tolerance),
        keep_shot_(settings.keep_shot * wish.weight),
        asked_(shot_from(wish.asked_m - wish.subjects_m, kAnyFovRad)),
        present_(shot_from(wish.present_m - wish.subjects_m, kAnyFovRad)) {}

  double sight_loss(size_t place) const {
    const SharesAt shares(viewpoints_, targets_.size(), place);
    return std::lerp(hidden_share(targets_, shares.seen_share()), hidden_share(targets_, shares.share_beside()),
                     settings_.predictive_power);
  }
  double shot_cost(size_t place) const {
    const glm::dvec3 offset_m = viewpoints_.offset_m(place);
    const ShotProperties shot = shot_from(offset_m - subjects_m_, kAnyFovRad);
    return keep_shot_ * (kAside * glm::distance(offset_m, asked_m_) / glm::length(asked_m_) +
                         shot_loss(deviation_between(asked_, shot, tolerance_), settings_.shot) +
                         kChange * shot_loss(deviation_between(present_, shot, tolerance_), settings_.shot));
  }

 private:
  const ViewpointMap& viewpoints_;
  const std::span<const TrackedTarget> targets_;
  const MoveSettings& settings_;
  const glm::dvec3 asked_m_, subjects_m_;
  const double tolerance_, keep_shot_;
  const ShotProperties asked_, present_;
};

}  // namespace

double hidden_round_about(const ViewpointMap& viewpoints, std::span<const TrackedTarget> targets, size_t place) {
  const SharesAt shares(viewpoints, targets.size(), place);
  const double first = hidden_share(targets, shares.seen_share()) + hidden_share(targets, shares.share_beside());
  const double alike = hidden_share_by_weight(targets, shares.seen_share()) +
                       hidden_share_by_weight(targets, shares.share_beside());
  return std::max(first, alike) / 2;
}

std::optional<size_t> choose_shot(const ViewpointMap& viewpoints, std::span<const TrackedTarget> targets,
                                  const ShotWish& wish, const MoveSettings& settings,
                                  const std::function<bool(const glm::dvec3& offset_m)>& allowed) {
  const auto is_good_enough = [&](size_t place, double hidden_below) {
    return hidden_round_about(viewpoints, targets, place) <= hidden_below && allowed(viewpoints.offset_m(place));
  };
  if (is_good_enough(wish.asked_place, wish.take_asked_below)) return wish.asked_place;
  if (is_good_enough(wish.former_place, settings.viewpoint_search.keep_shot_below)) return wish.former_place;
  const ShotCosts costs(viewpoints, targets, wish, settings);
  double least = std::numeric_limits<double>::infinity();
  std::optional<size_t> best;
  // The first of equal viewpoints wins, in whichever order they are tried.
  const auto try_place = [&](size_t place) {
    const double hold = place == wish.former_place ? settings.viewpoint_search.switch_margin : 0.0;
    const double sight_loss = costs.sight_loss(place);
    if (sight_loss - hold > least) return;
    const double cost = sight_loss + costs.shot_cost(place) - hold;
    const bool better = cost < least || (cost == least && best && place < *best);
    if (better && allowed(viewpoints.offset_m(place))) least = cost, best = place;
  };
  // The former viewpoint is usually near the best, so trying it first rules out most others cheaply.
  try_place(wish.former_place);
  for (size_t place = 0; place < ViewpointMap::kViewpoints; ++place)
    if (place != wish.former_place) try_place(place);
  return best;
}

}  // namespace sightline
