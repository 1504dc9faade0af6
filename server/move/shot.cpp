#include "server/move/shot.h"

#include <algorithm>
#include <array>
#include <limits>

#include "server/base/check.h"
#include "server/move/choose.h"
#include "server/scene/target.h"

namespace sightline {
namespace {

// The cost of coherence.h against both shots. What is hidden counts once for each, and so does a change.
double cost_of(const ShotCandidate& candidate, const ShotState& asked, const ShotState& present,
               std::span<const TargetView> targets, const CoherenceSettings& coherence) {
  return (shot_cost(candidate, asked, targets, coherence) +
          shot_cost(candidate, present, targets, coherence)) /
         2;
}

}  // namespace

Pose pose_of_shot(const glm::dvec3& center_m, const glm::dvec3& offset_m) {
  return {center_m + offset_m, look_rotation(-offset_m, {0, 1, 0}, {1, 0, 0})};
}

std::optional<size_t> choose_shot(const Survey& survey, std::span<const TargetView> targets,
                                  const ShotState& asked, size_t asked_place, const ShotState& present,
                                  size_t former, const ViewpointSearchSettings& settings,
                                  const CoherenceSettings& coherence,
                                  const std::function<bool(const glm::dvec3& offset_m)>& allowed) {
  const glm::dvec3 center_m = weighted_center_m(targets);
  std::array<float, kMaxTargets> seen, beside;
  // Without its pose, which costs more than all the rest.
  const auto candidate_at = [&](size_t place) {
    for (size_t i = 0; i < targets.size(); ++i) {
      seen[i] = survey.share(i, place);
      beside[i] = survey.share_beside(i, place);
    }
    ShotCandidate candidate{.world_from_camera = {}, .seen_share = std::span(seen).first(targets.size())};
    candidate.hidden_ahead = hidden_share(targets, std::span(beside).first(targets.size()));
    return candidate;
  };
  // Little may be hidden of the required targets, and of all targets alike.
  const auto is_good_enough = [&](size_t place) {
    const ShotCandidate candidate = candidate_at(place);
    const double first = hidden_share(targets, candidate.seen_share) + candidate.hidden_ahead;
    const double alike = hidden_share_by_weight(targets, candidate.seen_share) +
                         hidden_share_by_weight(targets, std::span(beside).first(targets.size()));
    return std::max(first, alike) / 2 <= settings.keep_shot_below;
  };
  for (const size_t place : {asked_place, former})
    if (is_good_enough(place) && allowed(survey.offset_m(place))) return place;
  double least = std::numeric_limits<double>::infinity();
  std::optional<size_t> best;
  // Of equal ones the first is taken, in whatever order they are tried.
  const auto try_place = [&](size_t place) {
    ShotCandidate candidate = candidate_at(place);
    const double hold = place == former ? settings.switch_margin : 0.0;
    if (unseen_cost(candidate, targets, coherence) - hold > least) return;
    candidate.world_from_camera = pose_of_shot(center_m, survey.offset_m(place));
    const double cost = cost_of(candidate, asked, present, targets, coherence) - hold;
    const bool better = cost < least || (cost == least && best && place < *best);
    if (better && allowed(survey.offset_m(place))) least = cost, best = place;
  };
  // The former is seldom far from the best: after it most others need no closer look.
  try_place(former);
  for (size_t place = 0; place < Survey::kPlaces; ++place)
    if (place != former) try_place(place);
  return best;
}

}  // namespace sightline
