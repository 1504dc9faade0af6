// The aggregate stage: the visibility from every candidate, now, over the last steps, and for the predicted targets
// (paper 3.3, 5).
#include <algorithm>

#include "server/base/inline_vector.h"
#include "server/move/framing.h"
#include "server/move/sight_weight.h"
#include "server/step/stages.h"

namespace sightline {
namespace {

// How much a new estimate of a slice counts beside the former ones.
constexpr double kNewShare = 0.35;

class Aggregation {
 public:
  Aggregation(const AggregateInput& in, CandidateMemory& memory, AggregateScratch& scratch, CandidateSights& sights)
      : step_(in.step),
        bound_(in.bound),
        taken_(in.taken),
        plan_(in.taken.plan),
        settings_(in.taken.settings),
        memory_(memory),
        scratch_(scratch),
        sights_(sights),
        candidates_(sights.candidates) {}

  void list_candidates();
  void fit_cells();
  void look_now();
  void add_up_hidden();
  void renew_slices();

 private:
  void take_from_moved_cells(auto& by_candidate) const;
  void mark_what_passes();
  HiddenWeights hidden_weights(double weight) const { return {scratch_.passes, step_.targets.sight_weights, weight}; }
  void smooth_what_passes();
  void find_outside(std::span<const glm::dvec3> aim_m);

  const StepContext& step_;
  const Bound& bound_;
  const TakenMaps& taken_;
  const SamplePlan& plan_;
  const AggregateSettings& settings_;
  CandidateMemory& memory_;
  AggregateScratch& scratch_;
  CandidateSights& sights_;
  CandidateSet& candidates_;
};

// `cover` gives cells addresses, since clearance and smoothed occlusion are stored by cell.
void Aggregation::list_candidates() {
  memory_.lattice.cover(bound_, settings_.candidates);
  list_cells(memory_.lattice, sights_);
}

// Moves cells to where the body fits. Their places follow the candidates for the look-ups.
void Aggregation::fit_cells() {
  list_places(candidates_.position_m, sights_.position_m);
  const std::span<const float> clearance_m = scratch_.clearance_cache.measure(
      step_.input.scene, memory_.lattice, bound_, sights_.position_m, route_radius_m(step_));
  sights_.clearance_m.assign(clearance_m.begin(), clearance_m.end());
  scratch_.places = candidates_.position_m;
  for (const uint32_t cell : scratch_.clearance_cache.moved()) scratch_.places.push_back(sights_.position_m[cell]);
}

// Gives each moved cell what was found for its place, and removes the places' own entries.
void Aggregation::take_from_moved_cells(auto& by_candidate) const {
  const std::span<const uint32_t> moved = scratch_.clearance_cache.moved();
  const size_t candidates = by_candidate.size() - moved.size();
  for (size_t k = 0; k < moved.size(); ++k) by_candidate[moved[k]] = by_candidate[candidates + k];
  by_candidate.resize(candidates);
}

// Marks the moving occluders, which may soon be gone. Targets are not marked, because they may hide each other for long
// while they walk together.
void Aggregation::mark_what_passes() {
  scratch_.passes.assign(step_.input.scene.instances().size(), 0);
  for (const uint32_t slot : step_.input.scene.moving_slots()) scratch_.passes[slot] = 1;
  for (const uint64_t id : step_.targets.ids) scratch_.passes[*step_.input.scene.slot_of(id)] = 0;
  for (const std::vector<TargetPiece>& pieces : step_.targets.pieces)
    for (const TargetPiece& piece : pieces) scratch_.passes[piece.slot] = 0;
}

// Finds the targets that each candidate sees now, and the share of them that is hidden.
void Aggregation::look_now() {
  Composer& composer = scratch_.composer;
  composer.set_positions(scratch_.places);
  scratch_.hidden_by.reset(scratch_.places.size());
  mark_what_passes();
  composer.visibility_and_hidden(taken_.of(plan_.now), settings_.relative_bias, hidden_weights(1.0),
                                 candidates_.visible_targets, scratch_.hidden_by);
  take_from_moved_cells(candidates_.visible_targets);
  take_from_moved_cells(scratch_.hidden_by.by_staying);
  take_from_moved_cells(scratch_.hidden_by.by_passing);
  candidates_.visible_targets[sights_.own_candidate] = seen_from_own_position(step_, taken_);
}

// The hidden share of the targets from each candidate now.
void Aggregation::add_up_hidden() {
  smooth_what_passes();
  const std::vector<double>&by_staying = scratch_.hidden_by.by_staying, &by_passing = scratch_.hidden_by.by_passing;
  sights_.hidden.resize(by_staying.size());
  for (size_t i = 0; i < by_staying.size(); ++i)
    sights_.hidden[i] = std::clamp(by_staying[i] + by_passing[i], 0.0, 1.0);
}

// The share of the targets' bodies that pictures from each cell cut off.
void Aggregation::find_outside(std::span<const glm::dvec3> aim_m) {
  InlineVector<Body, kMaxTargets> bodies;
  for (size_t i = 0; i < step_.target_count(); ++i) {
    const TrackedTarget& target = step_.targets.tracked_targets[i];
    bodies.push_back({aim_m[i] - glm::dvec3(0, target.low_m, 0), aim_m[i] + glm::dvec3(0, target.high_m, 0),
                      target.aside_m, step_.targets.sight_weights[i]});
  }
  // Judged by the whole picture: what lies in the margin that the aim keeps free is seen.
  scratch_.picture_fit.outside_share(bodies, widest(step_.lens, framing_of(step_.input)), step_.roll_rad(),
                                     scratch_.outside);
}

// What a picture from each cell is expected to lack at the slices that are due.
void Aggregation::renew_slices() {
  HiddenAhead& ahead = memory_.ahead;
  const uint64_t targets = hash_of(step_.targets, step_.targets.steered);
  if (targets != memory_.ahead_targets) ahead.restart();
  memory_.ahead_targets = targets;
  ahead.advance(memory_.lattice, step_.decision_s);
  const size_t cells = memory_.lattice.size();
  const double count = effective_count(step_.targets.sight_weights);
  scratch_.shares.resize(cells), scratch_.outside.assign(cells, 0.0f);
  const bool stays = step_.input.settings.move.follow == Follow::kStay;
  if (!stays && !plan_.slices.empty()) scratch_.picture_fit.set_places(std::span(sights_.position_m).first(cells));
  for (const SampledSlice& slice : plan_.slices) {
    HiddenShares& hidden = scratch_.hidden_by;
    hidden.reset(scratch_.places.size());
    scratch_.composer.add_hidden(taken_.of(slice.sampled), settings_.relative_bias, hidden_weights(1.0), hidden);
    take_from_moved_cells(hidden.by_staying);
    take_from_moved_cells(hidden.by_passing);
    if (!stays) find_outside(slice.aim_m);
    // Before renewals are averaged, since a target is rarely whole where it is often hidden in part.
    for (size_t i = 0; i < cells; ++i) {
      const double seen = 1 - picture_loss(std::min(hidden.by_staying[i] + hidden.by_passing[i], 1.0), count);
      scratch_.shares[i] = static_cast<float>(1 - seen * (1 - static_cast<double>(scratch_.outside[i])));
    }
    ahead.renew(slice.due.slice, memory_.lattice, scratch_.shares, kNewShare);
  }
}

// Low-passes the share that moving occluders hide, so that short occlusions count little.
void Aggregation::smooth_what_passes() {
  const FilterSettings& filter = settings_.filter;
  memory_.smoother.update(memory_.lattice, step_.decision_s,
                          filter.mode == FilterMode::kPerTarget ? filter.min_occlusion_s : 0.0,
                          scratch_.hidden_by.by_passing);
}

}  // namespace

glm::dvec3 nearest_in_bound_m(const Bound& bound, const glm::dvec3& position_m) {
  const glm::dvec3 out_m = position_m - bound.center_m;
  const double distance_m = glm::length(out_m), reach_m = bound.radius_m * (1 - 1e-9);
  return distance_m <= reach_m ? position_m : bound.center_m + out_m * (reach_m / distance_m);
}

uint32_t seen_from_own_position(const StepContext& step, const TakenMaps& taken) {
  uint32_t visible = 0;
  for (size_t i = 0; i < step.target_count(); ++i) {
    const OwnSight sight = own_sight(taken, i, step.camera.pose.position_m);
    if (is_enough(sight.seen, sight.points, taken.settings.visibility_threshold)) visible |= 1u << i;
  }
  return visible;
}

void list_cells(const Lattice& lattice, CandidateSights& sights) {
  sights.on_lattice = true;
  sights.texels.clear();
  sights.candidates.position_m.set_runs(lattice.spacing_m(), lattice.runs(), lattice.size());
}

void add_own_and_desired_position(const AggregateInput& in, CandidateSights& sights) {
  sights.own_candidate = sights.candidates.position_m.size();
  sights.candidates.position_m.push_back(in.step.camera.pose.position_m);
  if (in.step.targets.steered != 0) sights.candidates.position_m.push_back(nearest_in_bound_m(in.bound, in.desired_m));
}

void filter_cells(const StepContext& step, const FilterSettings& filter, CandidateMemory& memory,
                  std::vector<uint32_t>& slots, CandidateSet& candidates) {
  // The history counts steps only while a filter is on, so old entries must not pass for recent ones when it is
  // switched on again.
  if (filter.mode == FilterMode::kNone) memory.volume = {};
  if (filter.mode == FilterMode::kNone || step.move_s <= 0) return;
  const size_t cells = memory.lattice.size(), others = candidates.size() - cells;
  TemporalVolume& volume = memory.volume;
  volume.begin_step(memory.lattice, 2, step.targets.ids, filter, step.decision_s);
  volume.push(memory.lattice, std::span(candidates.visible_targets).first(cells));
  slots = memory.lattice.addresses();
  for (size_t k = 0; k < others; ++k) {
    volume.push_place(k, memory.lattice, candidates.position_m[cells + k], candidates.visible_targets[cells + k]);
    slots.push_back(volume.place_slot(k));
  }
  volume.filter(slots, candidates.visible_targets, step.targets.steered, candidates.filtered_targets);
}

namespace {

void aggregate_flight(const AggregateInput& in, CandidateMemory& memory, AggregateScratch& scratch,
                      CandidateSights& sights) {
  memory.pairs.clear();
  Aggregation aggregation(in, memory, scratch, sights);
  aggregation.list_candidates();
  add_own_and_desired_position(in, sights);
  aggregation.fit_cells();
  aggregation.look_now();
  filter_cells(in.step, in.taken.settings.filter, memory, scratch.slots, sights.candidates);
  aggregation.add_up_hidden();
  aggregation.renew_slices();
}

}  // namespace

void aggregate(const AggregateInput& in, CandidateMemory& memory, AggregateScratch& scratch, CandidateSights& sights) {
  sights.candidates.clear();
  const StepContext& step = in.step;
  if (step.input.targets.empty()) {
    memory.ahead.restart();
    memory.pairs.clear();
    return count_sights(sights.candidates, 0, 0, sights.counts);
  }
  if (follows_paper(step.input))
    aggregate_paper(in, memory, scratch, sights);
  else
    aggregate_flight(in, memory, scratch, sights);
  count_sights(sights.candidates, step.targets.steered, step.target_count(), sights.counts);
}

}  // namespace sightline
