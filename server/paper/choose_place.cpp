#include "server/paper/choose_place.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

namespace sightline {
namespace {

struct Weights {
  double required = 0, optional = 0;
};
Weights weight_seen(uint32_t visible, std::span<const TrackedTarget> targets) {
  Weights sum;
  for (size_t i = 0; i < targets.size(); ++i)
    if (visible >> i & 1u) (targets[i].required ? sum.required : sum.optional) += targets[i].weight;
  return sum;
}

// Orders candidates and tests the best ones for reachability. `Costs` has the cost of each candidate, and visits those
// that may be among the best.
template <typename Costs>
class Search {
 public:
  Search(const CandidateSet& candidates, std::span<const TrackedTarget> targets, const Costs& costs,
         double ahead_weight, const MoveSettings& settings, const Reachable& reachable, ChoiceScratch& scratch)
      : seen_(candidates.filtered()),
        seen_ahead_(candidates.ahead()),
        targets_(targets),
        costs_(costs),
        ahead_weight_(ahead_weight),
        limits_(targets, settings),
        reachable_(reachable),
        keys_(scratch.keys) {}

  // The first reachable one of the kMaxReachTests best wanted candidates, best first; -1 when there is none. Usually
  // the very best is reachable, and finding that one alone is faster. `alike`: all wanted candidates see the same
  // targets.
  template <typename Wanted>
  int best(Wanted wanted, bool alike) {
    collect(wanted, alike, 1);
    any_ = !keys_.empty();
    if (!any_) return -1;
    const uint32_t best = keys_.front().candidate;
    if (reachable_(keys_.front().place_m)) return static_cast<int>(best);
    collect(wanted, alike, kMaxReachTests);
    std::sort_heap(keys_.begin(), keys_.end(), better);
    for (const ChoiceKey& key : keys_)
      if (key.candidate != best && reachable_(key.place_m)) return static_cast<int>(key.candidate);
    return -1;
  }
  // Returns whether the last call of `best` found a wanted candidate.
  bool any() const { return any_; }

 private:
  // Keeps the best wanted candidates. Most others are worse by their visible targets and cost alone, so their limits
  // need not be tested.
  template <typename Wanted>
  void collect(Wanted wanted, bool alike, size_t kept) {
    keys_.clear();
    // Candidates of this cost or more are not kept any more.
    const auto enough = [&] {
      const bool settled = alike && ahead_weight_ == 0 && keys_.size() == kept && keys_.front().within_limits;
      return settled ? keys_.front().cost : std::numeric_limits<double>::infinity();
    };
    costs_.go_over(enough, [&](uint32_t i, const auto& cost_and_place) {
      if (!wanted(seen_[i])) return;
      const Weights weights = weight_of(i);
      ChoiceKey key{weights.required, weights.optional, 0.0, {}, i, true};
      const bool full = keys_.size() == kept;
      if (full && sees_less(key, keys_.front())) return;
      std::tie(key.cost, key.place_m) = cost_and_place();
      if (full && !better(key, keys_.front())) return;
      key.within_limits = limits_.hold(key.place_m);
      if (full && !better(key, keys_.front())) return;
      if (full) std::pop_heap(keys_.begin(), keys_.end(), better), keys_.pop_back();
      keys_.push_back(key);
      std::push_heap(keys_.begin(), keys_.end(), better);
    });
  }

  static bool sees_less(const ChoiceKey& a, const ChoiceKey& b) {
    return a.required != b.required ? a.required < b.required : a.optional < b.optional;
  }
  static bool better(const ChoiceKey& a, const ChoiceKey& b) {
    if (a.required != b.required) return a.required > b.required;
    if (a.optional != b.optional) return a.optional > b.optional;
    if (a.within_limits != b.within_limits) return a.within_limits;
    return a.cost != b.cost ? a.cost < b.cost : a.candidate < b.candidate;
  }

  Weights weight_of(uint32_t candidate) {
    const Weights now = now_.of(seen_[candidate], targets_);
    if (ahead_weight_ == 0) return now;
    const Weights ahead = ahead_.of(seen_ahead_[candidate], targets_);
    return {now.required * (1 - ahead_weight_) + ahead.required * ahead_weight_,
            now.optional * (1 - ahead_weight_) + ahead.optional * ahead_weight_};
  }

  // Neighbouring candidates usually see the same targets, so the last sum is cached.
  struct LastWeights {
    uint32_t visible = 0;
    Weights weights;  // seeing nothing weighs nothing
    const Weights& of(uint32_t seen, std::span<const TrackedTarget> targets) {
      if (seen != visible) visible = seen, weights = weight_seen(seen, targets);
      return weights;
    }
  };

  const std::span<const uint32_t> seen_, seen_ahead_;
  std::span<const TrackedTarget> targets_;
  const Costs& costs_;
  const double ahead_weight_;
  const PlaceLimits limits_;
  const Reachable& reachable_;
  std::vector<ChoiceKey>& keys_;  // a heap, the worst first
  bool any_ = false;
  LastWeights now_, ahead_;
};

using CostAndPlace = std::tuple<double, glm::dvec3>;

// Costs that the caller has computed.
struct ListedCosts {
  const PlaceList& places;
  std::span<const double> cost;

  template <typename Enough, typename Take>
  void go_over(const Enough&, const Take& take) const {
    for (uint32_t i = 0; i < cost.size(); ++i) take(i, [&]() -> CostAndPlace { return {cost[i], places[i]}; });
  }
};

// The cost of a candidate is its distance to a position. Runs are visited from the nearest one upwards and downwards,
// and each only as far as its candidates may be among the best.
class DistanceCosts {
 public:
  DistanceCosts(const PlaceView& places, const glm::dvec3& to_m) : places_(places), to_m_(to_m) {
    double least = std::numeric_limits<double>::infinity();
    for (size_t run = 0; run < places.runs().size(); ++run)
      if (const double squared = squared_beside(places.runs()[run]); squared < least) least = squared, nearest_ = run;
  }

  template <typename Enough, typename Take>
  void go_over(const Enough& enough, const Take& take) const {
    for (size_t k = 0; k < places_.singles_m().size(); ++k)
      take_place(static_cast<uint32_t>(places_.in_runs() + k), places_.singles_m()[k], take);
    for (size_t run = nearest_; run < places_.runs().size(); ++run) go_along(run, enough, take);
    for (size_t run = nearest_; run-- > 0;) go_along(run, enough, take);
  }

 private:
  // More than the rounding error of a distance, as a share of it and of the coordinates.
  static constexpr double kSlack = 1e-9;

  template <typename Take>
  void take_place(uint32_t i, const glm::dvec3& place_m, const Take& take) const {
    take(i, [&]() -> CostAndPlace { return {glm::distance(place_m, to_m_), place_m}; });
  }

  // Squared distance between the run's line and the position.
  double squared_beside(const PlaceRun& run) const {
    const double y = run.cell.y * places_.spacing_m() - to_m_.y, z = run.cell.z * places_.spacing_m() - to_m_.z;
    return y * y + z * z;
  }

  template <typename Enough, typename Take>
  void go_along(size_t number, const Enough& enough, const Take& take) const {
    const PlaceRun& run = places_.runs()[number];
    const auto count = static_cast<double>(places_.end_of_run(number) - run.first);
    double first = 0.0, end = count;
    if (const double reach_m = enough(); reach_m < std::numeric_limits<double>::infinity()) {
      const double slack_m = kSlack * (reach_m + glm::length(to_m_) + places_.spacing_m()), wide_m = reach_m + slack_m;
      const double squared = wide_m * wide_m - squared_beside(run) + slack_m * slack_m;
      if (squared < 0) return;
      const double middle = to_m_.x / places_.spacing_m() - run.cell.x,
                   half = std::sqrt(squared) / places_.spacing_m() + 1e-3;
      first = std::max(first, std::ceil(middle - half));
      end = std::min(end, std::floor(middle + half) + 1);
    }
    for (auto k = static_cast<int64_t>(first); k < static_cast<int64_t>(end); ++k) {
      const uint32_t i = run.first + static_cast<uint32_t>(k);
      take_place(i, places_.in_run(run, i), take);
    }
  }

  const PlaceView places_;
  const glm::dvec3 to_m_;
  size_t nearest_ = 0;
};

template <typename Costs>
Choice choose_by(const Costs& costs, const CandidateSet& candidates, std::span<const TrackedTarget> targets,
                 const glm::dvec3& desired_m, double ahead_weight, const MoveSettings& settings,
                 const Reachable& reachable, ChoiceScratch& scratch) {
  const uint32_t steered = steered_mask(targets);
  if (steered == 0) return {MoveStatus::kHolding, MoveReason::kNoTargets, -1};
  Search<Costs> search(candidates, targets, costs, ahead_weight, settings, reachable, scratch);

  if (const int best = search.best([=](uint32_t seen) { return (seen & steered) == steered; }, true); best >= 0) {
    const bool desired = glm::distance(candidates.position_m[static_cast<size_t>(best)], desired_m) < 1e-6;
    return {MoveStatus::kTracking, desired ? MoveReason::kAtDesiredPlace : MoveReason::kNearestAllVisible, best};
  }
  const bool any_all = search.any();
  if (const int best = search.best([=](uint32_t seen) { return (seen & steered) != 0 && (seen & steered) != steered; },
                                   false);
      best >= 0)
    return {MoveStatus::kPartial, MoveReason::kBestPartial, best};
  if (any_all || search.any()) return {MoveStatus::kHolding, MoveReason::kBlockedByGeometry, -1};
  return {MoveStatus::kEscaping, MoveReason::kHorizonGrown, search.best([](uint32_t) { return true; }, false)};
}

}  // namespace

Choice choose_place(const CandidateSet& candidates, std::span<const TrackedTarget> targets,
                    std::span<const double> cost, const glm::dvec3& desired_m, double ahead_weight,
                    const MoveSettings& settings, const Reachable& reachable, ChoiceScratch& scratch) {
  return choose_by(ListedCosts{candidates.position_m, cost}, candidates, targets, desired_m, ahead_weight, settings,
                   reachable, scratch);
}

Choice choose_basic(const CandidateSet& candidates, std::span<const TrackedTarget> targets, const glm::dvec3& desired_m,
                    double ahead_weight, const MoveSettings& settings, const Reachable& reachable,
                    ChoiceScratch& scratch) {
  return choose_by(DistanceCosts(candidates.position_m, desired_m), candidates, targets, desired_m, ahead_weight,
                   settings, reachable, scratch);
}

}  // namespace sightline
