#include "client/evaluate/reasons.h"

#include <algorithm>
#include <cmath>
#include <functional>

namespace sightline {
namespace {

// The kinds of claims about places.
enum class Says {
  kNothing,
  kAllSeenThere,   // all targets are seen from the place
  kSomeSeenThere,  // some target is
  kNoneSeesAll,    // no position in reach sees all targets
  kNoneSeesAny,    // none sees any
};
Says says(MoveReason reason) {
  switch (reason) {
    case MoveReason::kAtDesiredPlace:
    case MoveReason::kOtherShot:
    case MoveReason::kBestAllVisible:
    case MoveReason::kNearestAllVisible:
      return Says::kAllSeenThere;
    case MoveReason::kNearestView:
      return Says::kSomeSeenThere;
    case MoveReason::kBestPartial:
      return Says::kNoneSeesAll;
    case MoveReason::kHorizonGrown:
      return Says::kNoneSeesAny;
    default:
      return Says::kNothing;
  }
}
bool speaks_of_reach(MoveReason reason) {
  return says(reason) == Says::kNoneSeesAll || says(reason) == Says::kNoneSeesAny;
}

struct Seen {
  double least = 1.0, most = 0.0;
};
Seen seen_from(std::span<const size_t> targets, const SightEstimate& sight, const glm::dvec3& place_m) {
  Seen seen;
  for (const size_t i : targets) {
    const double share = sight.target_share(i, place_m, kClaimRays);
    seen.least = std::min(seen.least, share), seen.most = std::max(seen.most, share);
  }
  return seen;
}

// For each target of the world: whether it is hidden from the asked place, by frame.
std::vector<std::vector<bool>> hidden_from_places(ScenarioWorld& world, std::span<const AskedPlace> places) {
  std::vector<std::vector<bool>> hidden(world.targets().size());
  for (const AskedPlace& at : places) {
    world.set_time(at.time_s);
    for (size_t i = 0; i < hidden.size(); ++i) hidden[i].push_back(world.is_aim_hidden(world.targets()[i], at.place_m));
  }
  return hidden;
}

// Frames [first, end) whose times are in [from_s, to_s].
std::pair<size_t, size_t> frames_between(std::span<const AskedPlace> places, double from_s, double to_s) {
  const auto first = std::ranges::lower_bound(places, from_s - 1e-9, {}, &AskedPlace::time_s);
  const auto end = std::ranges::upper_bound(places, to_s + 1e-9, {}, &AskedPlace::time_s);
  return {static_cast<size_t>(first - places.begin()), static_cast<size_t>(std::max(first, end) - places.begin())};
}

void count_announced(std::span<const AskedPlace> places, uint64_t target, const std::vector<bool>& hidden,
                     ObstructionCounts& counts) {
  for (const AskedPlace& at : places) {
    const double then_s = at.time_s + at.soon_s;
    if (at.soon_target != target || then_s + kAnnouncedWithinS > places.back().time_s) continue;
    const auto [first, end] = frames_between(places, then_s - kAnnouncedWithinS, then_s + kAnnouncedWithinS);
    ++counts.announced;
    counts.came_true += std::find(hidden.begin() + static_cast<ptrdiff_t>(first),
                                  hidden.begin() + static_cast<ptrdiff_t>(end),
                                  true) != hidden.begin() + static_cast<ptrdiff_t>(end);
  }
}

// True if a target is hidden from a frame on for kObstructionS.
bool begins(std::span<const AskedPlace> places, const std::vector<bool>& hidden, size_t frame) {
  if (!hidden[frame] || hidden[frame - 1] || places[frame].time_s + kObstructionS > places.back().time_s) return false;
  const auto [first, end] = frames_between(places, places[frame].time_s, places[frame].time_s + kObstructionS);
  return std::all_of(hidden.begin() + static_cast<ptrdiff_t>(first), hidden.begin() + static_cast<ptrdiff_t>(end),
                     std::identity());
}

// A reply names one target, so of two that are hidden at about the same time only one must be announced.
void count_began(const ScenarioWorld& world, std::span<const AskedPlace> places,
                 const std::vector<std::vector<bool>>& hidden, ObstructionCounts& counts) {
  double last_s = -INFINITY;
  for (size_t k = 1; k < places.size(); ++k) {
    const double now_s = places[k].time_s;
    if (now_s < places[0].time_s + kWarningS || now_s < last_s + kAnnouncedWithinS) continue;
    bool began = false, announced = false;
    for (size_t i = 0; i < hidden.size(); ++i) {
      if (!begins(places, hidden[i], k)) continue;
      began = true;
      announced |= std::ranges::any_of(places.first(k), [&](const AskedPlace& at) {
        return at.soon_target == world.targets()[i].instance_id && at.time_s <= now_s - kWarningS &&
               std::abs(at.time_s + at.soon_s - now_s) <= kAnnouncedWithinS;
      });
    }
    if (!began) continue;
    last_s = now_s;
    ++counts.began, counts.began_announced += announced;
  }
}

}  // namespace

ObstructionCounts check_obstructions(ScenarioWorld& world, std::span<const AskedPlace> places) {
  const std::vector<std::vector<bool>> hidden = hidden_from_places(world, places);
  ObstructionCounts counts;
  for (size_t i = 0; i < hidden.size() && !places.empty(); ++i)
    count_announced(places, world.targets()[i].instance_id, hidden[i], counts);
  count_began(world, places, hidden, counts);
  return counts;
}

std::optional<ReasonClaim> claim_of(const StepDump& dump, double time_s, double body_radius_m) {
  const Decision& decision = dump.decision;
  const CandidateSights& sights = dump.sights;
  if (says(decision.reason) == Says::kNothing) return std::nullopt;
  ReasonClaim claim{.reason = decision.reason, .time_s = time_s, .target_ids = {}, .place_m = {}, .reach_m = {}};
  for (size_t i = 0; i < dump.targets.ids.size(); ++i)
    if ((dump.targets.steered >> i & 1u) != 0) claim.target_ids.push_back(dump.targets.ids[i]);
  // Only the default has a list of places where the body fits.
  const auto position_m = [&](size_t i) {
    return sights.position_m.empty() ? sights.candidates.position_m[i] : sights.position_m[i];
  };
  if (decision.chosen_candidate >= 0) claim.place_m = position_m(static_cast<size_t>(decision.chosen_candidate));
  if (!speaks_of_reach(decision.reason)) return claim.place_m ? std::optional(claim) : std::nullopt;
  for (size_t i = 0; i < sights.candidates.size(); ++i)
    if (sights.clearance_m.empty() || sights.clearance_m[i] >= body_radius_m) claim.reach_m.push_back(position_m(i));
  return claim;
}

Verdict check_claim(const ReasonClaim& claim, const ScenarioWorld& world, const SightEstimate& sight) {
  std::vector<size_t> targets;
  for (size_t i = 0; i < world.targets().size(); ++i)
    if (std::ranges::find(claim.target_ids, world.targets()[i].instance_id) != claim.target_ids.end())
      targets.push_back(i);
  const auto any_in_reach = [&](auto test) {
    return std::ranges::any_of(claim.reach_m,
                               [&](const glm::dvec3& place_m) { return test(seen_from(targets, sight, place_m)); });
  };
  bool holds = true;
  switch (says(claim.reason)) {
    case Says::kNothing:
      break;
    case Says::kAllSeenThere:
      holds = seen_from(targets, sight, claim.place_m.value()).least > 0;
      break;
    case Says::kSomeSeenThere:
      holds = seen_from(targets, sight, claim.place_m.value()).most > 0;
      break;
    case Says::kNoneSeesAll:
      holds = !any_in_reach([](const Seen& seen) { return seen.least >= kClearlySeen; });
      break;
    case Says::kNoneSeesAny:
      holds = !any_in_reach([](const Seen& seen) { return seen.most >= kClearlySeen; });
      break;
  }
  return holds ? Verdict::kHolds : Verdict::kFalse;
}

ReasonCounts check_reasons(ScenarioWorld& world, ExtentCache& extents, std::span<const ReasonClaim> claims) {
  ReasonCounts counts;
  const MoveSettings any_place;
  SightEstimate sight(world, extents, any_place, kClaimRays);
  double last_s = -1.0;
  for (const ReasonClaim& claim : claims) {
    if (claim.time_s <= last_s) continue;
    last_s = claim.time_s;
    world.set_time(claim.time_s);
    sight.refresh(0);
    ReasonCount& count = counts[claim.reason];
    ++count.claims;
    count.false_claims += check_claim(claim, world, sight) == Verdict::kFalse;
  }
  return counts;
}

}  // namespace sightline
