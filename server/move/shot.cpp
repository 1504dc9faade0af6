#include "server/move/shot.h"

#include <algorithm>
#include <array>
#include <limits>

#include "server/base/check.h"
#include "server/move/choose.h"
#include "server/scene/target.h"

namespace sightline {
namespace {

// The sum of the shot costs (coherence.h) against the asked and against the present shot.
double cost_of(const ShotCandidate& candidate, const ShotState& asked, const ShotState& present,
               std::span<const TrackedTarget> targets, const CoherenceSettings& coherence) {
  return (shot_cost(candidate, asked, targets, coherence) +
          shot_cost(candidate, present, targets, coherence)) /
         2;
}

// What is known of a viewpoint, target by target.
struct SharesAt {
  std::array<float, kMaxTargets> seen, beside;
  size_t targets;

  SharesAt(const ViewpointMap& viewpoints, size_t target_count, size_t place) : targets(target_count) {
    for (size_t i = 0; i < targets; ++i) seen[i] = viewpoints.share(i, place), beside[i] = viewpoints.share_beside(i, place);
  }
  std::span<const float> seen_share() const { return std::span(seen).first(targets); }
  std::span<const float> share_beside() const { return std::span(beside).first(targets); }
};

}  // namespace

Pose pose_of_shot(const glm::dvec3& center_m, const glm::dvec3& offset_m) {
  return {center_m + offset_m, look_rotation(-offset_m, {0, 1, 0}, {1, 0, 0})};
}

double hidden_round_about(const ViewpointMap& viewpoints, std::span<const TrackedTarget> targets, size_t place) {
  const SharesAt shares(viewpoints, targets.size(), place);
  const double first = hidden_share(targets, shares.seen_share()) + hidden_share(targets, shares.share_beside());
  const double alike = hidden_share_by_weight(targets, shares.seen_share()) + hidden_share_by_weight(targets, shares.share_beside());
  return std::max(first, alike) / 2;
}

std::optional<size_t> choose_shot(const ViewpointMap& viewpoints, std::span<const TrackedTarget> targets,
                                  const ShotState& asked, size_t asked_place, const ShotState& present,
                                  size_t former, double take_asked_below, const ViewpointSearchSettings& settings,
                                  const CoherenceSettings& coherence,
                                  const std::function<bool(const glm::dvec3& offset_m)>& allowed) {
  const glm::dvec3 center_m = weighted_center_m(targets);
  const auto is_good_enough = [&](size_t place, double hidden_below) {
    return hidden_round_about(viewpoints, targets, place) <= hidden_below && allowed(viewpoints.offset_m(place));
  };
  if (is_good_enough(asked_place, take_asked_below)) return asked_place;
  if (is_good_enough(former, settings.keep_shot_below)) return former;
  double least = std::numeric_limits<double>::infinity();
  std::optional<size_t> best;
  // The first of equal viewpoints wins, in whichever order they are tried.
  const auto try_place = [&](size_t place) {
    const SharesAt shares(viewpoints, targets.size(), place);
    ShotCandidate candidate{.world_from_camera = {}, .seen_share = shares.seen_share()};
    candidate.hidden_ahead = hidden_share(targets, shares.share_beside());
    const double hold = place == former ? settings.switch_margin : 0.0;
    if (unseen_cost(candidate, targets, coherence) - hold > least) return;
    // Last, because it is the most expensive part.
    candidate.world_from_camera = pose_of_shot(center_m, viewpoints.offset_m(place));
    const double cost = cost_of(candidate, asked, present, targets, coherence) - hold;
    const bool better = cost < least || (cost == least && best && place < *best);
    if (better && allowed(viewpoints.offset_m(place))) least = cost, best = place;
  };
  // The former viewpoint is usually near the best, so trying it first rules out most others cheaply.
  try_place(former);
  for (size_t place = 0; place < ViewpointMap::kViewpoints; ++place)
    if (place != former) try_place(place);
  return best;
}

}  // namespace sightline
